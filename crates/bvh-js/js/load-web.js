// Loads the WebAssembly that lies beside the JavaScript. Bundlers know this form of an address.
import init from '../wasm/bvh_js.js';

export async function load() {
    await init({ module_or_path: new URL('../wasm/bvh_js_bg.wasm', import.meta.url) });
}
