// Runs the firmware's Lee controller, power distribution and battery compensation on 4,000 random
// states, from gentle to far beyond the motors; prints the duty cycles of every tenth, or of all.
// usage: lee [all]
// The first half are single states. The second half is one run in which the integrals grow.
#include <stdio.h>
#include <stdlib.h>
#include <math.h>
#include "cfassert.h"
#include "math3d.h"
#include "controller_lee.h"
#include "platform_defaults.h"
#include "power_distribution_quadrotor.c"
#define NBR_OF_MOTORS 4
#include "motors.inc"

void assertFail(char *e, char *f, int l) { fprintf(stderr, "%s %s %d\n", e, f, l); exit(1); }

#ifdef CONFIG_PLATFORM_CF21BL
static const double mass = 0.0434, inertia[3] = {25.0e-6, 28.0e-6, 49.0e-6};
#else
static const double mass = 0.0328, inertia[3] = {16.8e-6, 16.8e-6, 29.8e-6};
#endif
// Gains as angular accelerations.
static const double attitude[3] = {331.9, 330.2, 341.7}, rate[3] = {78.4, 78.1, 68.3},
                    integral[3] = {724.0, 1081.0, 513.0};

// Uniform numbers from -1 to 1 (splitmix64), times a size.
static uint64_t state = 1;
static double within(double size) {
  uint64_t z = (state += 0x9E3779B97F4A7C15ULL);
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
  return size * (2 * (((z ^ (z >> 31)) >> 11) / 9007199254740992.0) - 1);
}
static struct vec vector(double x, double y, double z) {
  double a = within(x), b = within(y), c = within(z);
  return mkvec(a, b, c);
}
static struct vec torques(const double gain[3]) {
  return mkvec(inertia[0] * gain[0], inertia[1] * gain[1], inertia[2] * gain[2]);
}

int main(int argc, char **argv) {
  controllerLee_t lee;
  controllerLeeInit(&lee);
  lee.mass = mass;
  lee.J = mkvec(inertia[0], inertia[1], inertia[2]);
  lee.Kpos_P = mkvec(9, 9, 9);
  lee.Kpos_D = mkvec(7, 7, 7);
  lee.Kpos_I = mkvec(5, 5, 5);
  lee.KR = torques(attitude);
  lee.Komega = torques(rate);
  lee.KI = torques(integral);
  for (int k = 0; k < 4000; k++) {
    const int single = k < 2000;
    const double sizes[] = {0.03, 0.1, 0.3, 1.0}, volts[] = {4.15, 3.8, 3.4, 3.0};
    const double size = single ? sizes[k % 4] : 0.1, volt = volts[k / 4 % 4];
    setpoint_t setpoint = {0};
    setpoint.mode.x = setpoint.mode.y = setpoint.mode.z = setpoint.mode.yaw = modeAbs;
    const double heading = single ? within(3.0) : 0.6, yaw = within(0.5 * size) + heading;
    setpoint.attitude.yaw = heading * 180 / M_PI;
    struct vec a = vector(4 * size, 4 * size, 8 * size), j = vector(20 * size, 20 * size, 20 * size);
    setpoint.acceleration.x = a.x, setpoint.acceleration.y = a.y, setpoint.acceleration.z = a.z;
    if (k % 2) setpoint.jerk.x = j.x, setpoint.jerk.y = j.y, setpoint.jerk.z = j.z;
    state_t now = {0};
    struct vec p = vector(0.5 * size, 0.5 * size, 0.5 * size), v = vector(size, size, size);
    // Errors that stay, with speeds and rates against which their integrals balance; at last the
    // drone is above the design, where the thrust is 0 or less.
    const double t = single ? 0 : (k - 2000) * 0.002;
    if (!single) p.x += 0.8, v.x -= 0.8 * (9 + 5 * t) / 7;
    if (k >= 3800) p.z += 1.6;
    now.position.x = p.x, now.position.y = p.y, now.position.z = p.z;
    now.velocity.x = v.x, now.velocity.y = v.y, now.velocity.z = v.z;
    double roll = within(0.8 * size), pitch = within(0.8 * size) + (single ? 0 : 0.15);
    struct quat q = rpy2quat(mkvec(roll, pitch, yaw));
    now.attitudeQuaternion.x = q.x, now.attitudeQuaternion.y = q.y;
    now.attitudeQuaternion.z = q.z, now.attitudeQuaternion.w = q.w;
    struct vec w = vector(5 * size, 5 * size, 3 * size);
    if (!single) w.y -= 0.15 * (attitude[1] + integral[1] * t) / rate[1];
    sensorData_t sensors = {0};
    sensors.gyro.x = w.x * 180 / M_PI, sensors.gyro.y = w.y * 180 / M_PI, sensors.gyro.z = w.z * 180 / M_PI;
    if (single || k == 2000) controllerLeeReset(&lee);
    control_t control = {0};
    controllerLee(&lee, &control, &setpoint, &sensors, &now, 0);
    motors_thrust_uncapped_t thrust, compensated;
    powerDistribution(&control, &thrust);
    for (int i = 0; i < 4; i++) compensated.list[i] = motorsCompensateBatteryVoltage(i, thrust.list[i], volt);
    motors_thrust_pwm_t duty;
    powerDistributionCap(&compensated, &duty);
    if (k % 10 == 9 || argc > 1)
      printf("%d %d %d %d %d\n", k, duty.list[0], duty.list[1], duty.list[2], duty.list[3]);
  }
  return 0;
}
