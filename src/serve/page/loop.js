// Playback of an exposure, once or repeatedly.

const still = matchMedia("(prefers-reduced-motion: reduce)");
let film = 0;

export const stopLoop = () => cancelAnimationFrame(film);

/**
 * Plays the exposure of a photograph, shows the photograph, and begins again. Stops any earlier playback.
 * @param {(fraction: number) => void} show @param {HTMLElement} photo @param {HTMLCanvasElement} light
 * @param {number} written_ms @param {number} stands_ms Infinity to play only once
 */
export function loop(show, photo, light, written_ms, stands_ms) {
  stopLoop();
  if (still.matches) return;
  let begun = 0;
  const step = (/** @type {number} */ time) => {
    if (!light.isConnected) return;
    begun ||= time;
    if (time - begun > written_ms + stands_ms) begun = time;
    const share = (time - begun) / written_ms;
    light.hidden = share >= 1;
    photo.classList.toggle("unexposed", share < 1);
    if (share < 1) show(share);
    if (share < 1 || stands_ms < Infinity) film = requestAnimationFrame(step);
  };
  film = requestAnimationFrame(step);
}
