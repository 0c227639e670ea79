// Prints values as the firmware logs them in half precision (FP16): the value, and the bits of the half.
#include <stdio.h>
#include "num.h"

int main(void) {
  static const float values[] = {0.49987f, 0.49989f, 0.49995f, 0.5f, 0.50012f, 0.99990f, 1.0f, 1.9998f, -1.9998f,
                                 2.0f, 3.9998f, 7.9995f, 31.998f, 127.98f, -0.12498f, 0.1f, 0.25f, -3.3f, 65000.0f};
  for (int k = 0; k < sizeof(values) / sizeof(*values); k++) {
    printf("%.9g %04x\n", values[k], single2half(values[k]));
  }
  return 0;
}
