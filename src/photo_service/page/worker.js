// The worker of a page without a server: it holds the module, and makes one photograph at a time.

/** @type {(stage: number, share: number) => void} */
let tell = () => {};
const page = { progress: (/** @type {number} */ stage, /** @type {number} */ share) => tell(stage, share) };

/** About what the module has, where a host does not say it. */
const MODULE_BYTES = 2_600_000;

const ready = (async () => {
  const response = await fetch(new URL("noctograph.wasm.gz", import.meta.url));
  if (!response.ok || !response.body) throw new Error(`noctograph.wasm.gz: ${response.status}`);
  const { first, stream } = await counted(response.body, Number(response.headers.get("Content-Length")) || MODULE_BYTES);
  // Compressed, since not every host compresses what it sends; some say so, and it is unpacked.
  const module = first === 0x1f ? stream.pipeThrough(new DecompressionStream("gzip")) : stream;
  // Compiled while it arrives.
  const source = new Response(module, { headers: { "Content-Type": "application/wasm" } });
  const { instance } = await WebAssembly.instantiateStreaming(source, { page });
  postMessage({ loaded: 2 });
  return /** @type {any} */ (instance.exports);
})();

/**
 * A stream whose share that has arrived is told, and its first byte.
 * @param {ReadableStream<Uint8Array<ArrayBuffer>>} body @param {number} bytes
 */
async function counted(body, bytes) {
  const reader = body.getReader();
  let next = await reader.read();
  let arrived = 0,
    told = 0;
  const stream = new ReadableStream({
    async pull(controller) {
      if (next.done) return controller.close();
      controller.enqueue(next.value);
      arrived += next.value.length;
      const share = Math.floor((50 * arrived) / bytes) / 50;
      if (share > told) postMessage({ loaded: Math.min(0.98, (told = share)) });
      next = await reader.read();
    },
  });
  return { first: next.value?.[0], stream };
}

ready.catch(() => postMessage({ loaded: -1 }));

/** Calls a function of the module with a text, and returns how many bytes its answer has. */
async function call(/** @type {string} */ kind, /** @type {string} */ body) {
  const module = await ready;
  const request = new TextEncoder().encode(body);
  // To reserve place may move the memory.
  const place = module.reserve(request.length);
  new Uint8Array(module.memory.buffer, place, request.length).set(request);
  return { module, length: module[kind]() };
}

addEventListener("message", async ({ data: { kind, body } }) => {
  // Where there is no module, the first job says so.
  if (kind === "base") return call(kind, body).catch(() => {});
  try {
    let told = -1;
    tell = (stage, share) => {
      const done = Math.floor(20 * (stage ? 0.7 + 0.3 * share : 0.7 * share)) / 20;
      if (done !== told) postMessage({ done });
      told = done;
    };
    const { module, length } = await call(kind, body);
    const answer = new Uint8Array(module.memory.buffer, module.output(), length);
    postMessage({ answer: JSON.parse(new TextDecoder().decode(answer)), memory: module.memory.buffer.byteLength });
  } catch (error) {
    postMessage({ broken: String(error) });
  }
});
