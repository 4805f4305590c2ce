export function checkNames(options, accepted) {
    if (typeof options !== 'object' || options === null) throw new TypeError(`options is ${options}; accepted: an object`);
    const other = Object.keys(options).find((name) => !accepted.includes(name));
    if (other !== undefined) throw new TypeError(`option "${other}"; accepted: ${accepted.join(', ')}`);
}
