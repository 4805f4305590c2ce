// The worker's side of `bakeInWorker`: one message in, reports of the progress and one result out.
import { Tree } from '../wasm/bvh_js.js';
import { load } from '#load';

export async function answer({ corners, seconds, work, seed, references, follows }, say) {
    try {
        await load();
        const follow = follows ? (fraction, cost) => say({ fraction, cost }) : undefined;
        say({ bytes: Tree.bake(corners, seconds, work, seed, references, follow).save() });
    } catch (error) {
        say({ error: error.message });
    }
}
