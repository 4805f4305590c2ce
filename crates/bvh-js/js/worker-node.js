// A thread that speaks like a worker of a page.
import { Worker } from 'node:worker_threads';
import { installed, isHere } from './installed-node.js';

export function startWorker() {
    // Flags such as `--input-type` are for the program alone.
    // Bundlers know this form of an address.
    const worker = isHere(new URL('./bake-node.js', import.meta.url))
        ? new Worker(new URL('./bake-node.js', import.meta.url), { execArgv: [] })
        : new Worker(installed('js/bake-node.js'), { execArgv: [] });
    return {
        post: (message) => worker.postMessage(message, [message.corners.buffer]),
        hear: (listener) => worker.on('message', listener),
        fail: (listener) => worker.on('error', listener),
        end: () => worker.terminate(),
    };
}
