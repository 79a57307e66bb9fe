// What noisefloor for JavaScript takes for radiance.

/** Names of arrays whose elements are radiance, from whatever page or worker they come. */
const FLOATS = ["Float32Array", "Float64Array", "Float16Array"];

const a = (noun) => `${/^[aeiou]/i.test(noun) && !noun.startsWith("Ui") ? "an" : "a"} ${noun}`;

/** What is wrong with an array; integers, bits of half floats and text would silently become something else. */
export function whyNoRadiance(pixels, halfFloats) {
  const kind = Object.prototype.toString.call(pixels).slice(8, -1);
  if (halfFloats) {
    return kind === "Uint16Array" ? null : `half floats come as the bits in a Uint16Array, not in ${a(kind)}`;
  }
  if (FLOATS.includes(kind)) return null;
  if (kind !== "Array") {
    const half = kind === "Uint16Array" ? ", or halfFloats: true for the bits of half floats" : "";
    return `pixels in ${a(kind)} are no radiance: pass linear radiance in a Float32Array${half}`;
  }
  const odd = pixels.findIndex((value) => typeof value !== "number");
  return odd < 0 ? null : `pixels hold numbers, and element ${odd} is ${a(typeof pixels[odd])}`;
}

/** Of all bits of half floats, the numbers. */
let halves = null;

function halfTable() {
  return Float32Array.from({ length: 1 << 16 }, (_, bits) => {
    const [exponent, digits] = [(bits >> 10) & 31, bits & 1023];
    const size = exponent ? 2 ** (exponent - 25) * (1024 + digits) : 2 ** -24 * digits;
    return (bits >> 15 ? -1 : 1) * (exponent < 31 ? size : digits ? NaN : Infinity);
  });
}

/** The numbers of half floats. */
export function decoded(bits) {
  halves ??= halfTable();
  const numbers = new Float32Array(bits.length);
  for (let i = 0; i < numbers.length; i++) numbers[i] = halves[bits[i]];
  return numbers;
}
