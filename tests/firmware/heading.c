// Prints the heading of the goals of a compressed trajectory, rad, for headings in tenths of a degree, at
// the start, in the middle and after the end of the trajectory.
// usage: heading HEX     (HEX: a flight; its heading is replaced)
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "planner.h"

int main(int argc, char **argv) {
  static unsigned char data[4096];
  for (int i = 0; argv[1][2 * i]; i++) {
    char byte[3] = {argv[1][2 * i], argv[1][2 * i + 1], 0};
    data[i] = strtol(byte, NULL, 16);
  }
  static const short tenths[] = {-1800, -1571, -900, -450, -100, -1, 0, 1, 57, 300, 900, 1350, 1805};
  for (int k = 0; k < sizeof(tenths) / sizeof(*tenths); k++) {
    memcpy(data + 6, tenths + k, 2);
    static struct planner planner;
    static struct piecewise_traj_compressed trajectory;
    plan_init(&planner);
    piecewise_compressed_load(&trajectory, data);
    plan_start_compressed_trajectory(&planner, &trajectory, false, vzero());
    printf("%d", tenths[k]);
    for (int part = 0; part < 3; part++) {
      printf(" %.6f", plan_current_goal(&planner, 0.45f * part * trajectory.duration).yaw);
    }
    printf("\n");
  }
  return 0;
}
