"""The reader's net: a strip of light in, at every second column of pixels the logits of 62 characters, of no letter
and of the blank out. Trained with connectionist temporal classification (Graves and others 2006), so that no letter
needs a place of its own; stored as integers of 8 bits.
"""

import struct

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

# Kernel height and width, channels in and out, and how the rows are pooled after it.
LAYERS = [(3, 3, 2, 12, (2, 2)), (3, 3, 12, 24, (2, 1)), (3, 3, 24, 40, (2, 1)), (3, 3, 40, 64, (1, 1)),
          (5, 3, 64, 112, (1, 1)), (1, 5, 112, 96, (1, 1)), (1, 1, 96, 64, (1, 1))]
TOP = 6.0  # activations are clipped at this


def init(seed):
    rng = np.random.default_rng(seed)
    params = []
    for kh, kw, ci, co, _ in LAYERS:
        w = rng.normal(0, np.sqrt(2 / (kh * kw * ci)), (kh, kw, ci, co)).astype(np.float32)
        params.append({"w": w, "scale": np.ones(co, np.float32), "bias": np.zeros(co, np.float32)})
    stats = [(np.zeros(layer[3], np.float32), np.ones(layer[3], np.float32)) for layer in LAYERS]
    return params, stats


def pooled(x, by):
    if by == (1, 1):
        return x
    b, h, w, c = x.shape
    return x.reshape(b, h // by[0], by[0], w // by[1], by[1], c).max((2, 4))


def forward(params, stats, x, training):
    """Logits (batch, columns, classes) of strips (batch, rows, columns, 2) from 0 to 1, and the new statistics."""
    new = []
    for n, (layer, p, (mean, var)) in enumerate(zip(LAYERS, params, stats)):
        kh, kw, _, _, pool = layer
        rows = "VALID" if kh == 5 else "SAME"
        pad = [(0, 0) if rows == "VALID" else (kh // 2, kh // 2), (kw // 2, kw // 2)]
        x = lax.conv_general_dilated(x, p["w"], (1, 1), pad, dimension_numbers=("NHWC", "HWIO", "NHWC"))
        if n == len(LAYERS) - 1:
            new.append((mean, var))
            return (x + p["bias"])[:, 0], new
        if training:
            m, v = x.mean((0, 1, 2)), x.var((0, 1, 2))
            new.append((0.98 * mean + 0.02 * m, 0.98 * var + 0.02 * v))
        else:
            m, v = mean, var
            new.append((mean, var))
        x = (x - m) * (p["scale"] / jnp.sqrt(v + 1e-3)) + p["bias"]
        x = pooled(jnp.clip(x, 0, TOP), pool)


def integers(params, stats):
    """The net in integers: weights of 8 bits per output channel, biases and multipliers of 32, as bytes.

    Activations are bytes, 255 is TOP (the input: 1). A layer's output is
    clamp((sum(weight * byte) + bias) * multiplier >> 24); of the last, logits in 1/256.
    """
    out = b""
    for n, (layer, p, (mean, var)) in enumerate(zip(LAYERS, params, stats)):
        w, bias = np.asarray(p["w"], np.float64), np.asarray(p["bias"], np.float64)
        last = n == len(LAYERS) - 1
        if not last:
            factor = np.asarray(p["scale"], np.float64) / np.sqrt(np.asarray(var, np.float64) + 1e-3)
            bias = bias - np.asarray(mean, np.float64) * factor
            w = w * factor
        unit_in = (1.0 if n == 0 else TOP) / 255
        unit_out = 1 / 256 if last else TOP / 255
        step = np.abs(w).max((0, 1, 2)) / 127 + 1e-12
        w8 = np.round(w / step).astype(np.int8)
        multiplier = np.round(step * unit_in / unit_out * 2 ** 24).astype(np.int32)
        bias32 = np.round(bias / (step * unit_in)).astype(np.int32)
        # Output channel, kernel row, kernel column, input channel.
        out += struct.pack("<5B", layer[0], layer[1], layer[2], layer[3], layer[4][0] * 16 + layer[4][1])
        out += w8.transpose(3, 0, 1, 2).tobytes() + multiplier.tobytes() + bias32.tobytes()
    return out
