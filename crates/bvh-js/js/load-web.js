// Loads the WebAssembly that lies beside the JavaScript. Bundlers know this form of an address.
import init from '../wasm/bvh_js.js';
import { served } from './served-web.js';

export async function load() {
    const beside = new URL('../wasm/bvh_js_bg.wasm', import.meta.url);
    await init({ module_or_path: served('wasm/bvh_js_bg.wasm') ?? beside });
}
