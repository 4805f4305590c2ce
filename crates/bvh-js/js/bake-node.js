import { parentPort } from 'node:worker_threads';
import { answer } from './answer.js';

parentPort.once('message', (message) => answer(message, (said) => parentPort.postMessage(said)));
