// The worker of a page without a server, which runs the module and makes one photograph at a time.

/** @type {(stage: number, share: number) => void} */
let tell = () => {};
const page = { progress: (/** @type {number} */ stage, /** @type {number} */ share) => tell(stage, share) };

/** Approximate size of the module, if the host does not send it. */
const MODULE_BYTES = 2_600_000;

const ready = (async () => {
  const response = await fetch(new URL("noctograph.wasm.gz", import.meta.url));
  if (!response.ok || !response.body) throw new Error(`noctograph.wasm.gz: ${response.status}`);
  const { first, stream } = await counted(response.body, Number(response.headers.get("Content-Length")) || MODULE_BYTES);
  // The file is compressed, because not every host compresses. The browser unpacks it if the host says so.
  const module = first === 0x1f ? stream.pipeThrough(new DecompressionStream("gzip")) : stream;
  // The module is compiled while it arrives.
  const source = new Response(module, { headers: { "Content-Type": "application/wasm" } });
  const { instance } = await WebAssembly.instantiateStreaming(source, { page });
  postMessage({ loaded: 2 });
  return /** @type {any} */ (instance.exports);
})();

/**
 * Returns a stream that reports the fraction that has arrived, and its first byte.
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

/** Calls a function of the module with a text, and returns the number of bytes of its answer. */
async function call(/** @type {string} */ kind, /** @type {string} */ body) {
  const module = await ready;
  const request = new TextEncoder().encode(body);
  // Reserving memory may move the module's memory.
  const place = module.reserve(request.length);
  new Uint8Array(module.memory.buffer, place, request.length).set(request);
  return { module, length: module[kind]() };
}

addEventListener("message", async ({ data: { kind, body } }) => {
  // If there is no module, the first job reports this.
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
