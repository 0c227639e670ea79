// 20 timing memories, each played from 50 phases of the ring's timer: a digest of the colors shown.
#include <stdio.h>
#include <string.h>
#include <stdint.h>
#include <stdbool.h>
#define CONFIG_DECK_LEDRING_NBR_LEDS 12
static uint64_t us;
uint64_t usecTimestamp(void) { return us; }
static const uint8_t part_black[3] = {0, 0, 0};
#include "ring.inc"
int main(void) {
  uint32_t number = 7;
  for (int m = 0; m < 20; m++) {
    memset(&ledringtimingsmem, 0, sizeof(ledringtimingsmem));
    const int n = 1 + m % 9;
    for (int i = 0; i <= n; i++) {
      number = number * 1664525u + 1013904223u;
      const uint32_t dice = number >> 16;
      ledtiming *entry = &ledringtimingsmem.timings[i];
      entry->duration = i == n ? 2 : 1 + dice % 9;
      const uint16_t color = i % 2 || i == n ? 0 : dice | 1;
      entry->color[0] = color >> 8;
      entry->color[1] = color & 255;
    }
    for (int phase = 0; phase < 50; phase++) {
      uint8_t shown[12][3] = {{0}};
      uint32_t digest = 2166136261u;
      for (int tick = 0; tick < 100; tick++) {
        us = 1000ull * (10000 + phase + 50 * tick);
        if (tick == 0) us = 1000ull * 10000;
        timeMemEffect(shown, tick == 0);
        for (int c = 0; c < 3; c++) digest = (digest ^ shown[0][c]) * 16777619u;
      }
      printf("%08x%s", digest, phase % 10 == 9 ? "\n" : " ");
    }
  }
  return 0;
}
