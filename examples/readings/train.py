"""Trains the reader's network and writes its weights.

    python3 train.py PROGRAM OUT.bin FACES... [--photos STRIPS...] [--from START] [--minutes 60] [--seed 1] [--rounded]

Needs torch and numpy. PROGRAM is noctograph, which takes the faces apart; FACES are typefaces under free licenses and
names of our own fonts. STRIPS is what `readings strips` (the example) cut out of simulated photos. START is a
weights file or the checkpoint of a training. --rounded trains the net as the integers of use have it, its normalization
frozen: the end of the training.
"""

import argparse
import copy
import math
import multiprocessing
import os
import pickle
import struct
import time

import numpy as np
import torch
import torch.nn.functional as F

import net
import strips

BATCH = 32
LONGEST = 12  # letters of a photo
MEET = 16  # steps after which workers share


def read_strips(path):
    """Reads strips and labels that the example `readings strips` wrote, with None for a photo that shows nothing."""
    data, at, found = open(path, "rb").read(), 0, []
    while at + 4 <= len(data):
        n, width = struct.unpack_from("<HH", data, at)
        labels, at = list(data[at + 4:at + 4 + n]), at + 4 + n
        size = strips.HEIGHT * width * 2
        if at + size > len(data):
            break
        image = np.frombuffer(data, np.uint8, size, at).reshape(strips.HEIGHT, width, 2)
        at += size
        found.append((image, labels) if width else None)
    return found


def photo_batches(rng, photos, n_batches):
    """Yields batches of varied strips of photos: images, None and labels."""
    drawn = [photos[k] for k in rng.integers(0, len(photos), n_batches * BATCH)]
    drawn.sort(key=lambda photo: photo[0].shape[1])
    made = []
    for at in range(0, len(drawn), BATCH):
        group = drawn[at:at + BATCH]
        width = max(photo[0].shape[1] for photo in group)
        width = (int(width * 1.12) + 1) // 2 * 2
        images = np.zeros((BATCH, strips.HEIGHT, width, 2), np.uint8)
        for n, (image, _) in enumerate(group):
            images[n, :, :image.shape[1]] = image
        widths = np.array([photo[0].shape[1] for photo in group])
        images = varied(rng, torch.from_numpy(images), widths, width)
        made.append((images, None, [photo[1] for photo in group]))
    return [made[k] for k in rng.permutation(len(made))]


def varied(rng, images, widths, width):
    """Varies strips of photos: moves, stretches, slants and bends them, changes blur, brightness and noise, and hides
    letters."""
    n = len(images)
    draw = lambda low, high: torch.from_numpy(rng.uniform(low, high, n).astype(np.float32))
    gauss = lambda sigma: torch.from_numpy(rng.normal(0, sigma, n).astype(np.float32))
    some = lambda share: torch.from_numpy(rng.random(n) < share)
    each = lambda values: values[:, None, None]
    light = (images.permute(0, 3, 1, 2).float() / 255) ** 2
    # Source position of each pixel of the new strip, in pixels of the old strip.
    y, x = torch.meshgrid(torch.arange(strips.HEIGHT) - 19.0, torch.arange(width, dtype=torch.float32), indexing="ij")
    from_x = each(draw(0.9, 1.13)) * x - each(draw(0, 4)) + each(gauss(0.07)) * y
    from_y = each(torch.exp(gauss(0.05))) * y + each(gauss(1.0))
    bend = torch.from_numpy(rng.normal(0, 1, (n, 2, 4, width // 12 + 2)).astype(np.float32))
    bend = F.interpolate(bend, (strips.HEIGHT, width), mode="bicubic", align_corners=True)
    bend = bend * torch.abs(gauss(0.5) * some(0.7))[:, None, None, None] * 1.5
    grid = torch.stack([2 * (from_x + bend[:, 0] + 0.5) / width - 1,
                        2 * (from_y + bend[:, 1] + 19.5) / strips.HEIGHT - 1], 3)
    light = F.grid_sample(light, grid, align_corners=False)
    sigma = torch.abs(gauss(0.7)) * some(0.3)
    if rng.random() < 0.5:
        flat = light.permute(1, 0, 2, 3).reshape(2 * n, strips.HEIGHT, width)
        light = strips.blurred(flat, torch.cat([sigma, sigma])).reshape(2, n, strips.HEIGHT, width).permute(1, 0, 2, 3)
    uneven = F.interpolate(torch.from_numpy(rng.normal(0, 1, (n, 1, width // 25 + 2)).astype(np.float32)), width,
                           mode="linear", align_corners=True)[:, :, None]
    light = light * torch.exp(uneven * torch.abs(gauss(0.3) * some(0.5))[:, None, None, None])
    gain = torch.exp(gauss(0.35))
    second = torch.where(some(0.3), draw(0.2, 1.0), torch.ones(n))
    light = light * torch.stack([gain, gain * second], 1)[:, :, None, None]
    noise = 10 ** draw(-4.5, -1.7)
    grain = torch.randn(n, 1, strips.HEIGHT, width)
    light = (light + grain * noise[:, None, None, None] * torch.tensor([1, 0.7])[:, None, None]).clamp(0, 1)
    # A small hole hides a part of a letter, which is still the same letter.
    at = torch.from_numpy(rng.uniform(0, 1, (2, n)).astype(np.float32))
    size = draw(2, 5) * some(0.2)
    hole = (each(at[0] * torch.from_numpy(widths.astype(np.float32))) - x).abs() + (each(at[1] * 24 - 12) - y).abs()
    light = light * (hole > each(size))[:, None]
    return torch.round(255 * torch.sqrt(light)).to(torch.uint8).permute(0, 2, 3, 1)


def loss_of(logits, targets, labels):
    """Returns the loss of drawn strips, for each column against its target and for the labels in their order as in
    photos."""
    ln_p = F.log_softmax(logits, 2)
    lengths = torch.tensor([len(label) for label in labels])
    flat = torch.tensor([k for label in labels for k in label])
    each = F.ctc_loss(ln_p.transpose(0, 1), flat, torch.full((len(labels),), logits.shape[1]), lengths,
                      reduction="none", zero_infinity=True)
    # A strip without information must not outweigh the others.
    each = each / lengths
    ctc = (5 * torch.tanh(each / 5)).mean()
    if targets is None:
        return ctc, ctc
    letter = ln_p.gather(2, targets.abs()[..., None])[..., 0]
    either = torch.logaddexp(letter, ln_p[..., 0])
    weight = torch.where(targets > 0, 1.0, 0.3)
    return -(torch.where(targets < 0, either, letter) * weight).sum() / weight.sum(), ctc


def photos_of(paths):
    found = [photo for path in paths if os.path.exists(path) for photo in read_strips(path)]
    return [photo for photo in found if photo and 0 < len(photo[1]) <= LONGEST and photo[0].shape[1] <= strips.MOST_PX]


def supply(queue, seed, faces, weights, paths):
    """Puts batches into a queue endlessly, either drawn ones or those of photos, whose files may grow in the
    meantime."""
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    rng, read_at, photos = np.random.default_rng(seed), 0, []
    while True:
        if paths and time.monotonic() - read_at > 300:
            photos, read_at = photos_of(paths), time.monotonic()
        made = photo_batches(rng, photos, 16) if paths else strips.batches(rng, faces, weights, 16, BATCH)
        for images, targets, labels in made:
            queue.put((images.numpy(), None if targets is None else targets.numpy(), labels))


def meet(model, shared, lock):
    """Moves the weights a part of the way to the mean of all workers, which train in parallel."""
    with lock, torch.no_grad():
        for own, common in zip(model.state_dict().values(), shared):
            if own.is_floating_point():
                common.lerp_(own, 0.5)
                own.copy_(common)


def work(number, args, model, queues, shared, lock):
    """Trains the network, and averages it with other workers from time to time. Returns its mean over the last
    steps."""
    torch.set_num_threads(1)
    rng = np.random.default_rng([args.seed, number])
    optimizer = torch.optim.AdamW(model.parameters(), args.rate, weight_decay=1e-3)
    began, tick, steps, recent = time.monotonic(), 0, 0, {"drawn": [], "photos": []}
    mean = copy.deepcopy(model)
    while True:
        spent = (time.monotonic() - began) / 60 / args.minutes
        if spent >= 1:
            break
        source = "photos" if args.photos and rng.random() < args.share else "drawn"
        images, targets, labels = queues[source].get()
        images = torch.from_numpy(images)
        targets = None if targets is None else torch.from_numpy(targets)
        kind = "columns" if targets is not None and spent < args.columns else source
        rate = args.rate * min(1, (steps + 10) / 100) * max(0.01, 0.5 * (1 + math.cos(math.pi * spent)))
        for group in optimizer.param_groups:
            group["lr"] = rate
        x = (images.float() / 255).permute(0, 3, 1, 2).contiguous(memory_format=torch.channels_last)
        with torch.autocast("cpu", torch.bfloat16, enabled=not args.rounded):
            logits = model(x)
        value, ctc = loss_of(logits, targets if kind == "columns" else None, labels)
        if kind == "columns":
            value = value + 0.3 * ctc
        optimizer.zero_grad()
        value.backward()
        torch.nn.utils.clip_grad_norm_(model.parameters(), 3.0)
        optimizer.step()
        steps += 1
        recent[source].append(ctc.item())
        kept = min(0.999, 1 - 1 / (steps + 1))
        with torch.no_grad():
            for a, b in zip(mean.state_dict().values(), model.state_dict().values()):
                a.lerp_(b, 1 - kept) if a.is_floating_point() else a.copy_(b)
        if steps % MEET == 0:
            meet(model, shared, lock)
        if number == 0 and time.monotonic() - tick > 30:
            tick = time.monotonic()
            print(f"{spent:.3f} of the time, {steps} steps; nats a letter: drawn "
                  f"{np.mean(recent['drawn'][-200:]):.3f}, photos {np.mean(recent['photos'][-200:] or [0]):.3f}", flush=True)
            torch.save(mean.state_dict(), args.out + ".tmp")
            os.replace(args.out + ".tmp", args.out + ".pt")
    return mean


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("out")
    parser.add_argument("faces", nargs="*")
    parser.add_argument("--photos", nargs="*", default=[])
    parser.add_argument("--share", type=float, default=0.5, help="of batches of photos")
    parser.add_argument("--from", dest="start")
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--columns", type=float, default=0.3, help="part of the time in which drawn columns have targets")
    parser.add_argument("--rate", type=float, default=3e-3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--rounded", action="store_true")
    args = parser.parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(args.seed)
    if args.faces and args.faces[0].endswith(".pkl"):
        faces = pickle.load(open(args.faces[0], "rb"))
    else:
        faces = strips.load_faces(args.program, args.faces)
    weights = np.array([face[3] for face in faces], float)
    faces = [face[2] for face in faces]

    model = net.Net()
    if args.start and args.start.endswith(".bin"):
        drawn = strips.batches(np.random.default_rng(args.seed), faces, weights / weights.sum(), 1, 256)[0][0]
        model = net.from_integers(open(args.start, "rb").read(), (drawn.float() / 255).permute(0, 3, 1, 2))
    elif args.start:
        model.load_state_dict(torch.load(args.start))
    model = model.to(memory_format=torch.channels_last)
    model.rounded = args.rounded
    shared = [value.clone().contiguous().share_memory_() for value in model.state_dict().values()]
    lock = multiprocessing.Lock()
    queues = {}
    for kind, paths in (("drawn", []), ("photos", args.photos)):
        if kind == "drawn" or paths:
            queues[kind] = multiprocessing.Queue(24)
            multiprocessing.Process(target=supply, daemon=True, args=(
                queues[kind], args.seed + len(queues), faces, weights / weights.sum(), paths)).start()
    workers = [multiprocessing.Process(target=work, daemon=True, args=(number, args, model, queues, shared, lock))
               for number in range(1, args.workers)]
    for worker in workers:
        worker.start()
    mean = work(0, args, model, queues, shared, lock)
    torch.save(mean.state_dict(), args.out + ".pt")
    open(args.out, "wb").write(net.integers(mean))
    print(os.path.getsize(args.out), "bytes")


if __name__ == "__main__":
    main()
