import { answer } from './answer.js';
import { load } from './load-web.js';

self.onmessage = (event) => answer(load, event.data, (said) => self.postMessage(said));
