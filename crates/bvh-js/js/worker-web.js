import { served } from './served-web.js';

export function startWorker() {
    const moved = served('js/bake-web.js');
    const worker = moved ? new Worker(moved, { type: 'module' })
        : new Worker(new URL('./bake-web.js', import.meta.url), { type: 'module' });
    return {
        post: (message) => worker.postMessage(message, [message.corners.buffer]),
        hear: (listener) => worker.addEventListener('message', (event) => listener(event.data)),
        // The browser says nothing of a worker that it could not fetch.
        fail: (listener) => worker.addEventListener('error', (event) => listener(new Error(event.message
            || 'the worker bake-web.js of bvh-search could not be loaded; where `vite dev` up to 7 has '
            + 'its cacheDir or bvh-search in another folder than its own node_modules, '
            + "`optimizeDeps: { exclude: ['bvh-search'] }` lets it be found"))),
        end: () => worker.terminate(),
    };
}
