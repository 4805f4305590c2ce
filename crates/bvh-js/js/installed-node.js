// A bundle for Node.js may leave the files of this package behind: the installed package has them.
import { existsSync } from 'node:fs';
import { fileURLToPath } from 'node:url';

export function isHere(url) {
    return url.protocol === 'file:' && existsSync(fileURLToPath(url));
}

export function installed(path) {
    try {
        return new URL(`../${path}`, import.meta.resolve('bvh-search'));
    } catch {
        throw new Error(`${path} of bvh-search is not beside the bundle; accepted: a bundle that leaves bvh-search out as external, or the package installed where the bundle runs`);
    }
}
