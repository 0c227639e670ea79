"""The reader's net: a strip of light in, at every second column of pixels the logits of 62 characters, of no letter
and of the blank out. Trained with connectionist temporal classification (Graves and others 2006), so that no letter
needs a place of its own; stored as integers of 8 bits.
"""

import struct

import numpy as np
import torch
import torch.nn.functional as F
from torch import nn

# Kernel height and width, channels in and out, how the rows and columns are pooled after it, and the columns from one
# of its kernel to the next: 0 for neighbors; else the layer's output is added to its input, so that a letter is seen
# with those beside it.
LAYERS = [(3, 3, 2, 12, (2, 2), 0), (3, 3, 12, 24, (2, 1), 0), (3, 3, 24, 40, (2, 1), 0), (3, 3, 40, 64, (1, 1), 0),
          (5, 3, 64, 112, (1, 1), 0), (1, 5, 112, 96, (1, 1), 0), (1, 7, 96, 96, (1, 1), 0),
          (1, 5, 96, 96, (1, 1), 2), (1, 5, 96, 96, (1, 1), 4), (1, 3, 96, 96, (1, 1), 8), (1, 1, 96, 64, (1, 1), 0)]
TOP = 6.0  # activations are clipped at this
EPSILON = 1e-3


class Net(nn.Module):
    """Maps strips (batch, 2, rows, columns) with values from 0 to 1 to logits (batch, columns / 2, classes)."""

    def __init__(self):
        super().__init__()
        self.convs = nn.ModuleList(
            nn.Conv2d(ci, co, (kh, kw), bias=layer is LAYERS[-1], dilation=(1, step or 1),
                      padding=(0 if kh == 5 else kh // 2, kw // 2 * (step or 1)))
            for layer in LAYERS for kh, kw, ci, co, _, step in [layer])
        self.norms = nn.ModuleList(nn.BatchNorm2d(layer[3], eps=EPSILON, momentum=0.02) for layer in LAYERS[:-1])
        for conv in self.convs:
            nn.init.kaiming_normal_(conv.weight, nonlinearity="relu")
        for norm, layer in zip(self.norms, LAYERS):
            if layer[5]:
                nn.init.zeros_(norm.weight)  # what is added begins as nothing
        self.rounded = False  # weights and activations as integers of 8 bits have them, for the end of the training

    def forward(self, x):
        for conv, norm, layer in zip(self.convs, self.norms, LAYERS):
            before = x if layer[5] else 0.0
            if self.rounded:
                factor = norm.weight / torch.sqrt(norm.running_var + EPSILON)
                weight = as_bytes(conv.weight * factor[:, None, None, None])
                x = F.conv2d(x, weight, norm.bias - norm.running_mean * factor, padding=conv.padding,
                             dilation=conv.dilation)
                # When the network is used, sums are rounded down.
                x = x + (torch.floor(x * (255 / TOP)) * (TOP / 255) - x).detach()
                x = (before + x).clamp(0, TOP)
            else:
                x = (before + norm(conv(x))).clamp(0, TOP)
            if layer[4] != (1, 1):
                x = F.max_pool2d(x, layer[4])
        last = self.convs[-1]
        weight = as_bytes(last.weight) if self.rounded else last.weight
        return F.conv2d(x, weight, last.bias)[:, :, 0].transpose(1, 2).float()


def step_of(weight):
    """Returns the step between two integer weights of each output channel."""
    return weight.abs().amax((1, 2, 3), keepdim=True) / 127 + 1e-12


def as_bytes(weight):
    step = step_of(weight).detach()
    return weight + (torch.round(weight / step) * step - weight).detach()


def integers(net):
    """Returns the net in integers, as bytes: weights of 8 bits per output channel, biases and multipliers of 32 bits.

    Activations are bytes, of which 255 stands for TOP, or for 1 in the input. A layer's output is
    clamp(input + ((sum(weight * byte) + bias) * multiplier >> 24)), with the input only if the layer adds it. The last
    layer's output is logits in units of 1/256.
    """
    out = b""
    for n, (layer, conv) in enumerate(zip(LAYERS, net.convs)):
        w, last = conv.weight.detach().double(), n == len(LAYERS) - 1
        if last:
            bias = conv.bias.detach().double()
        else:
            norm = net.norms[n]
            factor = (norm.weight / torch.sqrt(norm.running_var + EPSILON)).detach().double()
            bias = norm.bias.detach().double() - norm.running_mean.double() * factor
            w = w * factor[:, None, None, None]
        unit_in = (1.0 if n == 0 else TOP) / 255
        unit_out = 1 / 256 if last else TOP / 255
        step = step_of(w)
        w8 = torch.round(w / step).to(torch.int8).numpy()
        step = step[:, 0, 0, 0].numpy()
        multiplier = np.round(step * unit_in / unit_out * 2 ** 24).astype(np.int32)
        bias32 = np.round(bias.numpy() / (step * unit_in)).astype(np.int32)
        # Output channel, kernel row, kernel column, input channel.
        out += struct.pack("<6B", *layer[:4], layer[4][0] * 16 + layer[4][1], layer[5])
        out += w8.transpose(0, 2, 3, 1).tobytes() + multiplier.tobytes() + bias32.tobytes()
    return out


def from_integers(data, strips):
    """Returns the network of a weights file for further training, with its normalization set from a batch of strips."""
    net, at, x = Net(), 0, strips
    with torch.no_grad():
        for n, (layer, conv) in enumerate(zip(LAYERS, net.convs)):
            kh, kw, ci, co, _, apart = layer
            size, last = kh * kw * ci * co, n == len(LAYERS) - 1
            w8 = np.frombuffer(data, np.int8, size, at + 6).reshape(co, kh, kw, ci).transpose(0, 3, 1, 2)
            multiplier, bias = np.frombuffer(data, "<i4", 2 * co, at + 6 + size).reshape(2, co).astype(float)
            at += 6 + size + 8 * co
            unit_in = (1.0 if n == 0 else TOP) / 255
            step = multiplier / 2 ** 24 * (1 / 256 if last else TOP / 255) / unit_in
            conv.weight.copy_(torch.from_numpy(w8 * step[:, None, None, None]))
            bias = torch.from_numpy(bias * step * unit_in).float()
            if last:
                conv.bias.copy_(bias)
                break
            before, x, norm = x, conv(x), net.norms[n]
            norm.running_mean.copy_(x.mean((0, 2, 3)))
            norm.running_var.copy_(x.var((0, 2, 3)))
            norm.weight.copy_(torch.sqrt(norm.running_var + EPSILON))
            norm.bias.copy_(bias + norm.running_mean)
            x = F.max_pool2d(((before if apart else 0) + x + bias[:, None, None]).clamp(0, TOP), layer[4])
    return net
