// Runs the firmware's PID cascade for 2,000 ticks on states in closed form; prints every fifth.
#include <stdio.h>
#include <stdlib.h>
#include <math.h>
#include "stabilizer_types.h"
#include "controller_pid.h"

void assertFail(char *e, char *f, int l) { fprintf(stderr, "%s %s %d\n", e, f, l); exit(1); }

int main(void) {
  controllerPidInit();
  for (int k = 0; k < 2000; k++) {
    const double t = k * 0.002, grows = k < 1000 ? 1 : 4;
    setpoint_t setpoint = {0};
    setpoint.mode.x = setpoint.mode.y = setpoint.mode.z = setpoint.mode.yaw = modeAbs;
    setpoint.position.x = 0.3 * sin(1.3 * t);
    setpoint.position.y = 0.2 * sin(0.9 * t);
    setpoint.position.z = 0.8 + 0.1 * sin(0.7 * t);
    state_t state = {0};
    state.position.x = 0.3 * sin(1.3 * t) + 0.03 * grows * sin(3.1 * t);
    state.position.y = 0.2 * sin(0.9 * t) - 0.02 * grows * sin(2.3 * t);
    state.position.z = 0.8 + 0.1 * sin(0.7 * t) + 0.02 * grows * sin(1.9 * t);
    state.velocity.x = 0.2 * grows * sin(2.9 * t);
    state.velocity.y = 0.15 * grows * sin(3.7 * t);
    state.velocity.z = 0.1 * grows * sin(2.2 * t);
    const double yaw = 0.3 * sin(1.1 * t), pitch = 0.05 * grows * sin(5.3 * t), roll = 0.06 * grows * sin(4.7 * t);
    state.attitude.yaw = yaw * 180 / M_PI;
    state.attitude.pitch = -pitch * 180 / M_PI;
    state.attitude.roll = roll * 180 / M_PI;
    sensorData_t sensors = {0};
    sensors.gyro.x = 0.5 * grows * sin(11 * t) * 180 / M_PI;
    sensors.gyro.y = 0.4 * grows * sin(13 * t) * 180 / M_PI;
    sensors.gyro.z = 0.2 * grows * sin(7 * t) * 180 / M_PI;
    control_t control = {0};
    controllerPid(&control, &setpoint, &sensors, &state, 2 * k);
    if (k % 5 == 4) printf("%d %d %d %d %.2f\n", k, control.roll, -control.pitch, -control.yaw, control.thrust);
  }
  return 0;
}
