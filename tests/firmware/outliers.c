// 500 decisions of the firmware's filter of sweeps: runs of good and of bad ones, with gaps.
#include <stdio.h>
#include "outlierFilterLighthouse.h"
int main(void) {
  OutlierFilterLhState_t filter;
  outlierFilterLighthouseReset(&filter, 0);
  uint32_t ms = 0, number = 1;
  for (int k = 0; k < 500; k++) {
    number = number * 1664525u + 1013904223u;
    const uint32_t dice = number >> 24;
    ms += (dice % 7 == 0) ? 40 : (dice % 3);
    const int bad = (k / 50) % 2 ? dice < 160 : dice < 40;
    printf("%d", outlierFilterLighthouseValidateSweep(&filter, 2.0f, bad ? 0.3f : 0.001f * (dice % 20), ms));
  }
  printf("\n");
  return 0;
}
