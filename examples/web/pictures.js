// Pictures by rays: the shaded model, and the tests that each pixel took by either tree.
import { Box3, DoubleSide, PerspectiveCamera, Ray, Spherical, Vector3 } from 'three';
import { countTests } from 'bvh-search';
import { pause } from './compare.js';

const [WIDTH, HEIGHT] = [320, 240];
/** From few tests to many, from dark to light, in even steps to the eye. */
const COLOURS = [[0, 0, 4], [51, 16, 104], [120, 28, 109], [187, 55, 84], [237, 105, 37], [252, 181, 25], [252, 255, 164]];

function colour(part) {
    const at = Math.min(Math.max(part, 0), 1) * (COLOURS.length - 1);
    const from = Math.min(Math.floor(at), COLOURS.length - 2);
    return COLOURS[from].map((value, channel) => value + (at - from) * (COLOURS[from + 1][channel] - value));
}

/** A camera in fractions of a geometry's box. */
export class View {
    constructor(geometry, { eye, target }) {
        const bounds = new Box3().setFromBufferAttribute(geometry.attributes.position);
        const size = bounds.getSize(new Vector3());
        // A flat model is seen from outside, too.
        size.max(new Vector3().setScalar(0.3 * Math.max(size.x, size.y, size.z)));
        const place = (fractions) => new Vector3(...fractions).subScalar(0.5).multiply(size).add(bounds.getCenter(new Vector3()));
        this.eye = place(eye);
        this.target = place(target);
        this.isInside = bounds.containsPoint(this.eye);
    }

    /** Turns the model, or the head of who is in it. */
    turn(right, down) {
        const [pivot, other] = this.isInside ? [this.eye, this.target] : [this.target, this.eye];
        const arm = new Spherical().setFromVector3(other.clone().sub(pivot));
        const way = this.isInside ? 1 : -1;
        arm.theta += way * right;
        arm.phi += way * down;
        other.setFromSpherical(arm.makeSafe()).add(pivot);
    }

    /** The rays through the pixels of a picture, row by row. */
    rays(width = WIDTH, height = HEIGHT) {
        const camera = new PerspectiveCamera(50, width / height);
        camera.position.copy(this.eye);
        camera.lookAt(this.target);
        camera.updateMatrixWorld();
        return Array.from({ length: width * height }, (_, pixel) => {
            const x = (2 * ((pixel % width) + 0.5)) / width - 1;
            const y = 1 - (2 * (Math.floor(pixel / width) + 0.5)) / height;
            return new Ray(this.eye.clone(), new Vector3(x, y, 0.5).unproject(camera).sub(this.eye).normalize());
        });
    }
}

/**
 * Draws the model and both maps, on one scale. `isWanted` says whether to go on. Returns the number
 * of tests at the end of the scale.
 */
export async function draw(view, [before, after], canvases, { coarse = 1, most, isWanted = () => true }) {
    const [width, height] = [WIDTH / coarse, HEIGHT / coarse];
    const rays = view.rays(width, height);
    const images = canvases.map(() => new ImageData(width, height));
    const tests = [new Float32Array(rays.length), new Float32Array(rays.length)];
    for (let pixel = 0; pixel < rays.length; pixel++) {
        if (pixel % (16 * WIDTH) === 0) {
            await pause();
            if (!isWanted()) return most;
        }
        const counts = [before, after].map((bvh) => countTests(bvh, rays[pixel], { side: DoubleSide }));
        counts.forEach(({ boxes, triangles }, tree) => { tests[tree][pixel] = boxes + triangles; });
        const { hit } = counts[0];
        if (hit) {
            const light = 0.2 + 0.8 * Math.abs(hit.face.normal.dot(rays[pixel].direction));
            images[0].data.set([205 * light, 200 * light, 190 * light, 255], 4 * pixel);
        }
    }
    // A few pixels at the silhouette take many more than the others.
    most ??= Math.max(1, tests[0].slice().sort()[Math.floor(0.99 * rays.length)]);
    tests.forEach((map, tree) => {
        map.forEach((count, pixel) => images[1 + tree].data.set([...colour(count / most), 255], 4 * pixel));
    });
    canvases.forEach((canvas, at) => {
        [canvas.width, canvas.height] = [width, height];
        canvas.getContext('2d').putImageData(images[at], 0, 0);
    });
    return most;
}

export function drawScale(canvas) {
    const image = new ImageData(canvas.width, 1);
    for (let x = 0; x < canvas.width; x++) image.data.set([...colour(x / (canvas.width - 1)), 255], 4 * x);
    canvas.getContext('2d').putImageData(image, 0, 0);
}
