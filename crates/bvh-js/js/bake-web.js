import { answer } from './answer.js';

self.onmessage = (event) => answer(event.data, (said) => self.postMessage(said));
