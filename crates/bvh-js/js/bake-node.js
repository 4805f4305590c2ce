import { parentPort } from 'node:worker_threads';
import { answer } from './answer.js';
import { load } from './load-node.js';

parentPort.once('message', (message) => answer(load, message, (said) => parentPort.postMessage(said)));
