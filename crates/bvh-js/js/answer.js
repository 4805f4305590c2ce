// The worker's side of `bakeInWorker`: one message in, reports of the progress and one result out. It
// is told how to load, because an import map of the page does not hold in a worker.
import { axes, bake } from '../wasm/bvh_js.js';

export async function answer(load, { asks, corners, seconds, work, seed, references, follows }, say) {
    try {
        await load();
        const follow = follows ? (fraction, cost) => say({ fraction, cost }) : undefined;
        const found = asks === 'axes' ? axes(corners) : bake(corners, seconds, work, seed, references, follow);
        say({ found });
    } catch (error) {
        say({ error: error.message });
    }
}
