// Checks of the options that functions take, by name and by value.

export function checkNames(options, accepted) {
    if (typeof options !== 'object' || options === null) throw new TypeError(`options is ${options}; accepted: an object`);
    const other = Object.keys(options).find((name) => !accepted.includes(name));
    if (other !== undefined) throw new TypeError(`option "${other}"; accepted: ${accepted.join(', ')}`);
}

/** The options of a bake with their defaults; `more` are the names of others. */
export function checked(options, more = []) {
    checkNames(options, ['seconds', 'work', 'seed', 'references', 'orient', 'onProgress', ...more]);
    const { seconds, work, seed = 1, references = 1, orient: orients = false, onProgress, signal } = options;
    const check = (name, value, accepted, isAccepted) => {
        if (value !== undefined && !(typeof value === 'number' && isAccepted(value))) {
            const found = typeof value === 'string' ? `"${value}"` : value;
            throw new RangeError(`${name} is ${found}; accepted: ${accepted}`);
        }
    };
    check('seconds', seconds, 'a number above 0', (value) => value > 0);
    check('work', work, 'a whole number above 0, below 2^53', (value) => value > 0 && Number.isSafeInteger(value));
    check('seed', seed, 'a whole number from 0 on, below 2^53', (value) => value >= 0 && Number.isSafeInteger(value));
    check('references', references, 'a number from 1 to 16', (value) => value >= 1 && value <= 16);
    if (typeof orients !== 'boolean') throw new TypeError(`orient is ${orients}; accepted: true or false`);
    if (onProgress !== undefined && typeof onProgress !== 'function') {
        throw new TypeError(`onProgress is ${onProgress}; accepted: a function`);
    }
    if (signal !== undefined && typeof signal?.throwIfAborted !== 'function') {
        throw new TypeError(`signal is ${signal}; accepted: an AbortSignal`);
    }
    return { seconds, work, seed, references, orient: orients };
}
