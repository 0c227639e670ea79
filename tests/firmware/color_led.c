// Levels that the color LED deck is given for every byte of white, red, green and blue.
#include <stdio.h>
#include <stdint.h>
#include "color_led_deck.h"
#include "color_led.inc"
int main(void) {
  for (int channel = 0; channel < 4; channel++) {
    for (int value = 0; value < 256; value++) {
      const wrgb_t wrgb = {value, value, value, value}, out = applyBrightnessCorrection(&wrgb);
      printf("%02x", channel == 0 ? out.w : channel == 1 ? out.r : channel == 2 ? out.g : out.b);
    }
    printf("\n");
  }
  return 0;
}
