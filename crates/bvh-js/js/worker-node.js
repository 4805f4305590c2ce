// A thread that speaks like a worker of a page.
import { Worker } from 'node:worker_threads';

export function startWorker() {
    // Flags such as `--input-type` are for the program alone.
    const worker = new Worker(new URL('./bake-node.js', import.meta.url), { execArgv: [] });
    return {
        post: (message) => worker.postMessage(message, [message.corners.buffer]),
        hear: (listener) => worker.on('message', listener),
        fail: (listener) => worker.on('error', listener),
        end: () => worker.terminate(),
    };
}
