// Loads the WebAssembly that lies beside the JavaScript.
import init from '../wasm/bvh_js.js';
import { beside, served } from './served-web.js';

export async function load() {
    await init({ module_or_path: served('wasm/bvh_js_bg.wasm') ?? beside() });
}
