// Runs the planner of the commander on board on a compressed trajectory, and prints its goals.
// usage: planner HEX
#include <stdio.h>
#include <stdlib.h>
#include <math.h>
#include "planner.h"

int main(int argc, char **argv) {
  static unsigned char data[4096];
  for (int i = 0; argv[1][2 * i]; i++) {
    char byte[3] = {argv[1][2 * i], argv[1][2 * i + 1], 0};
    data[i] = strtol(byte, NULL, 16);
  }
  static struct planner planner;
  static struct piecewise_traj_compressed trajectory;
  plan_init(&planner);
  piecewise_compressed_load(&trajectory, data);
  plan_start_compressed_trajectory(&planner, &trajectory, false, vzero());
  printf("bytes %s\n", argv[1]);
  for (int k = 0; k < 4 * trajectory.duration + 40; k++) {
    struct traj_eval goal = plan_current_goal(&planner, k / 4.0f);
    // As `crtpCommanderHighLevelGetSetpoint`, which gives no more setpoints after one that is none.
    if (!is_traj_eval_valid(&goal)) { printf("no goal at %.2f s\n", k / 4.0); return 0; }
    printf("%.2f %.6f %.6f %.6f\n", k / 4.0, goal.pos.x, goal.pos.y, goal.pos.z);
  }
  return 0;
}
