export function startWorker() {
    const worker = new Worker(new URL('./bake-web.js', import.meta.url), { type: 'module' });
    return {
        post: (message) => worker.postMessage(message, [message.corners.buffer]),
        hear: (listener) => worker.addEventListener('message', (event) => listener(event.data)),
        fail: (listener) => worker.addEventListener('error', (event) => listener(new Error(event.message))),
        end: () => worker.terminate(),
    };
}
