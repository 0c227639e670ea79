"""Trains the reader's net and writes its weights.

    python3 train.py PROGRAM OUT.bin FACES... [--photos STRIPS] [--from CHECKPOINT] [--minutes 20] [--seed 1] [--frozen]

Needs jax, optax, numpy, scipy, Pillow. PROGRAM is noctograph, which takes the faces apart; FACES are typefaces under
free licences and names of our own fonts. STRIPS is what `readings strips` (the example) cut out of simulated photos.
"""

import os

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")

import argparse
import pickle
import random
import struct
import time

import jax
import jax.numpy as jnp
import numpy as np
import optax

import net
import strips

BATCH = 32


def batches(examples, rng, of_photos):
    """Batches of strips about equally wide: images and column targets, or of photos, whose letters have no places,
    images, logit paddings, labels, label paddings."""
    examples = sorted(examples, key=lambda example: example[0].shape[1])
    groups = [examples[n:n + BATCH] for n in range(0, len(examples) - BATCH + 1, BATCH)]
    rng.shuffle(groups)
    for group in groups:
        step = 96 if of_photos else 64
        width = -(-max(example[0].shape[1] for example in group) // step) * step
        images = np.zeros((BATCH, strips.HEIGHT, width, 2), np.uint8)
        paddings = np.ones((BATCH, width // 2), np.float32)
        labels, label_paddings = np.zeros((BATCH, 12), np.int32), np.ones((BATCH, 12), np.float32)
        targets = np.zeros((BATCH, width // 2), np.int32)
        for n, (image, label, *ends) in enumerate(group):
            images[n, :, :image.shape[1]] = image
            if not of_photos:
                targets[n, :image.shape[1] // 2] = strips.column_targets(image.shape[1], label, ends[0])
                continue
            paddings[n, :image.shape[1] // 2] = 0
            labels[n, :len(label)] = label
            label_paddings[n, :len(label)] = 0
        yield (images, paddings, labels, label_paddings) if of_photos else (images, targets)


def read_strips(path):
    """Strips and labels as the example `readings strips` writes them."""
    data, at, found = open(path, "rb").read(), 0, []
    while at < len(data):
        n, width = struct.unpack_from("<HH", data, at)
        labels, at = list(data[at + 4:at + 4 + n]), at + 4 + n
        size = strips.HEIGHT * width * 2
        image = np.frombuffer(data, np.uint8, size, at).reshape(strips.HEIGHT, width, 2)
        at += size
        if 0 < n <= 12 and width <= 330:
            found.append((image, labels))
    return found


def varied(rng, image):
    """A strip of a photo moved up or down, brighter or dimmer, wider or narrower, its second channel dimmer still."""
    image = np.roll(image, rng.randint(-2, 2), 0).astype(np.float32)
    columns = np.linspace(0, image.shape[1] - 1, int(image.shape[1] * rng.uniform(0.88, 1.15)) // 2 * 2)
    image = image[:, np.round(columns).astype(int)]
    image *= [rng.uniform(0.6, 1.3), rng.uniform(0.4, 1.2)]
    return np.clip(image + np.random.default_rng(rng.getrandbits(32)).normal(0, 3, image.shape), 0, 255).astype(np.uint8)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("out")
    parser.add_argument("faces", nargs="*")
    parser.add_argument("--photos")
    parser.add_argument("--from", dest="start")
    parser.add_argument("--minutes", type=float, default=20)
    parser.add_argument("--rate", type=float, default=2e-3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--frozen", action="store_true", help="normalize as in use, for the end of the training")
    args = parser.parse_args()
    rng = random.Random(args.seed)
    faces = []
    for path, trace, face in strips.load_faces(args.program, args.faces):
        faces += [face] * (1 if trace == "outline" else 3 if path.endswith((".ttf", ".otf")) else 8)
    photos = read_strips(args.photos) if args.photos else []

    params, stats = net.init(args.seed)
    if args.start:
        params, stats = pickle.load(open(args.start, "rb"))
    rate = {"now": args.rate}
    optimizer = optax.inject_hyperparams(
        lambda learning_rate: optax.chain(optax.clip_by_global_norm(3.0), optax.adamw(learning_rate, weight_decay=1e-4))
    )(learning_rate=args.rate)
    state = optimizer.init(params)

    def loss(params, stats, images, *wanted):
        logits, new = net.forward(params, stats, images.astype(jnp.float32) / 255, not args.frozen)
        if len(wanted) == 1:
            targets = wanted[0]
            ln_p = jax.nn.log_softmax(logits)
            letter = jnp.take_along_axis(ln_p, jnp.abs(targets)[..., None], -1)[..., 0]
            either = jnp.logaddexp(letter, ln_p[..., 0])
            # Letters count as much as the many blanks.
            weight = jnp.where(targets > 0, 1.0, 0.3)
            return -(jnp.where(targets < 0, either, letter) * weight).sum() / weight.sum(), new
        paddings, labels, label_paddings = wanted
        each = optax.ctc_loss(logits, paddings, labels, label_paddings)
        # A strip that says nothing must not outweigh those that say something.
        return (jnp.minimum(each, 20.0) / jnp.maximum(1.0, (1 - label_paddings).sum(1))).mean(), new

    @jax.jit
    def step(params, stats, state, *batch):
        (value, new), slope = jax.value_and_grad(loss, has_aux=True)(params, stats, *batch)
        updates, state = optimizer.update(slope, state, params)
        return optax.apply_updates(params, updates), new, state, value

    began, steps, recent, pool, seen = time.process_time(), 0, {True: [], False: []}, [], 0
    while True:
        spent = (time.process_time() - began) / 60 / args.minutes
        if spent >= 1:
            break
        rate["now"] = args.rate * min(1.0, (steps + 10) / 200) * max(0.02, 1 - spent)
        fresh = [strips.strip(rng, faces) for _ in range(96)]
        seen += len(fresh)
        # Every strip is used twice, with half of those drawn before.
        mixed = list(batches(fresh + rng.sample(pool, min(len(pool), len(fresh))), rng, False))
        if photos:
            drawn = rng.sample(photos, min(len(photos), 192))
            mixed += batches([(varied(rng, image), labels) for image, labels in drawn], rng, True)
        pool = (pool + fresh)[-6000:]
        for batch in mixed:
            state.hyperparams["learning_rate"] = jnp.asarray(rate["now"])
            params, stats, state, value = step(params, stats, state, *batch)
            steps += 1
            recent[len(batch) == 2].append(float(value))
        if steps // 200 != (steps - len(mixed)) // 200:
            print(f"{spent:.3f} of the time, {steps} steps, {seen} drawn, loss "
                  f"{np.mean(recent[True][-200:]):.4f}, photos {np.mean(recent[False][-60:] or [0]):.4f}", flush=True)
            pickle.dump(jax.device_get((params, stats)), open(args.out + ".pkl", "wb"))
    params, stats = jax.device_get((params, stats))
    pickle.dump((params, stats), open(args.out + ".pkl", "wb"))
    open(args.out, "wb").write(net.integers(params, stats))
    print(steps, "steps, loss", np.mean(recent[True][-500:]), len(net.integers(params, stats)), "bytes")


if __name__ == "__main__":
    main()
