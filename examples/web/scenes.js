// The built-in scenes, made of three's own geometries, the same on every machine.
import {
    BoxGeometry, BufferGeometry, CylinderGeometry, Euler, LatheGeometry, Matrix4, Quaternion, SphereGeometry, TorusGeometry,
    TorusKnotGeometry, Vector2, Vector3,
} from 'three';
import { mergeGeometries } from 'three/addons/utils/BufferGeometryUtils.js';

/** Corners alone: one geometry of positions without an index. */
export function positions(geometry) {
    const plain = geometry.index ? geometry.toNonIndexed() : geometry;
    return new BufferGeometry().setAttribute('position', plain.attributes.position.clone());
}

export const merge = (parts) => mergeGeometries(parts.map(positions));

/** Numbers from 0 to 1, the same in every run. */
export function random(seed) {
    return () => {
        seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
        return seed / 2 ** 32;
    };
}

function placed(geometry, place, turn = [0, 0, 0]) {
    const rotation = new Quaternion().setFromEuler(new Euler(...turn));
    return geometry.applyMatrix4(new Matrix4().compose(new Vector3(...place), rotation, new Vector3(1, 1, 1)));
}

const box = (size, place, turn) => placed(new BoxGeometry(...size), place, turn);

/** A hall of 12 × 4 × 8 metres with beams, columns, shelves of books, tables, chairs and lamps. */
function hall() {
    const next = random(7);
    const parts = [
        box([12, 0.1, 8], [0, -0.05, 0]),
        box([12, 0.1, 8], [0, 4.05, 0]),
        box([0.1, 4, 8], [-6.05, 2, 0]),
        box([0.1, 4, 8], [6.05, 2, 0]),
        box([12, 4, 0.1], [0, 2, -4.05]),
        box([12, 4, 0.1], [0, 2, 4.05]),
    ];
    for (let beam = 0; beam < 12; beam++) parts.push(box([0.12, 0.2, 8], [beam - 5.5, 3.9, 0]));
    for (let plank = 0; plank < 60; plank++) parts.push(box([12, 0.02, 0.128], [0, 0.01, (plank - 29.5) * 0.132]));
    const outline = [[0.3, 0], [0.3, 0.1], [0.22, 0.2], [0.18, 0.5], [0.16, 3.2], [0.22, 3.6], [0.3, 3.7], [0.3, 3.8]];
    for (let column = 0; column < 10; column++) {
        const lathe = new LatheGeometry(outline.map(([x, y]) => new Vector2(x, y)), 32);
        parts.push(placed(lathe, [(column % 5) * 2.4 - 4.8, 0, column < 5 ? -2.4 : 2.4]));
    }
    for (const wall of [-1, 1]) {
        for (let shelf = 0; shelf < 7; shelf++) {
            const height = 0.3 + 0.45 * shelf;
            parts.push(box([11, 0.03, 0.3], [0, height, wall * 3.8]));
            for (let x = -5.4; x < 5.4;) {
                const thickness = 0.02 + 0.05 * next();
                const size = [thickness, 0.22 + 0.16 * next(), 0.16 + 0.1 * next()];
                parts.push(box(size, [x + thickness / 2, height + 0.015 + size[1] / 2, wall * 3.8], [0, 0, 0.04 * (next() - 0.5)]));
                x += thickness + (next() < 0.04 ? 0.2 : 0.002);
            }
        }
    }
    for (let table = 0; table < 4; table++) {
        const x = table * 2.6 - 3.9;
        parts.push(box([1.8, 0.05, 0.9], [x, 0.75, 0]));
        for (const [dx, dz] of [[-0.8, -0.4], [0.8, -0.4], [-0.8, 0.4], [0.8, 0.4]]) {
            parts.push(placed(new CylinderGeometry(0.03, 0.02, 0.73, 16), [x + dx, 0.365, dz]));
        }
        for (let cup = 0; cup < 12; cup++) {
            parts.push(placed(new TorusGeometry(0.04, 0.012, 10, 24), [x + 1.6 * (next() - 0.5), 0.79, 0.7 * (next() - 0.5)], [Math.PI / 2, 0, 0]));
        }
        for (let chair = 0; chair < 4; chair++) {
            const [dx, dz, turn] = [(chair % 2) * 0.8 - 0.4, chair < 2 ? -0.75 : 0.75, next() - 0.5];
            const at = [x + dx, 0.45, dz];
            parts.push(box([0.45, 0.04, 0.45], at, [0, turn, 0]));
            for (let rod = 0; rod < 9; rod++) {
                const lean = dz < 0 ? -1 : 1;
                parts.push(placed(new CylinderGeometry(0.01, 0.01, 0.6, 8), [at[0] + (rod - 4) * 0.05, 0.75, at[2] + lean * 0.25], [lean * 0.15, 0, 0]));
            }
            for (const [lx, lz] of [[-0.2, -0.2], [0.2, -0.2], [-0.2, 0.2], [0.2, 0.2]]) {
                parts.push(placed(new CylinderGeometry(0.015, 0.01, 0.45, 8), [at[0] + lx, 0.22, at[2] + lz], [lz * 0.3, 0, -lx * 0.3]));
            }
        }
        parts.push(placed(new CylinderGeometry(0.005, 0.005, 1.6, 6), [x, 3.1, 0]));
        parts.push(placed(new SphereGeometry(0.18, 48, 24), [x, 2.2, 0]));
    }
    return merge(parts);
}

/** Poles and planks at all angles, as a scaffold or a plant of pipes has. */
function scaffold() {
    const next = random(3);
    const parts = Array.from({ length: 3000 }, () => {
        const length = 0.1 * 60 ** next();
        const place = [0, 1, 2].map(() => 10 * next() - 5);
        const isStraight = next() < 0.6;
        const turn = [0, 1, 2].map(() => (isStraight ? (Math.PI / 2) * Math.floor(4 * next()) : Math.PI * next()));
        return next() < 0.5
            ? placed(new CylinderGeometry(0.04, 0.04, length, 10, 1), place, turn)
            : box([0.02, length, 0.3], place, turn);
    });
    return merge(parts);
}

/** Names, what they show, their triangles and, in fractions of the box, the eye and its target. */
export const scenes = {
    hall: { title: 'hall with books and chairs', make: hall, eye: [0.04, 0.55, 0.42], target: [0.8, 0.3, 0.55] },
    scaffold: { title: 'scaffold', make: scaffold },
    knot: { title: 'smooth knot', make: () => positions(new TorusKnotGeometry(1, 0.35, 1200, 40)) },
};

/** What the eye of any other model sees. */
export const outside = { eye: [1.5, 1.1, 1.9], target: [0.5, 0.5, 0.5] };
