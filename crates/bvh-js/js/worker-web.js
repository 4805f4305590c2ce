export function startWorker() {
    const worker = new Worker(new URL('./bake-web.js', import.meta.url), { type: 'module' });
    return {
        post: (message) => worker.postMessage(message, [message.corners.buffer]),
        hear: (listener) => worker.addEventListener('message', (event) => listener(event.data)),
        // The browser says nothing of a worker that it could not fetch.
        fail: (listener) => worker.addEventListener('error', (event) => listener(new Error(event.message
            || 'the worker bake-web.js of bvh-search could not be loaded; in `vite dev` up to 7, '
            + "`optimizeDeps: { exclude: ['bvh-search'] }` lets it be found"))),
        end: () => worker.terminate(),
    };
}
