// Runs the firmware's Kalman filter on a motion in closed form and prints its states.
// usage: filter sweeps|ranges|differences|positions|tilts|precise
// tilts: ranges of a motion twice as fast, which leans beyond the cone of the ranger
// precise: positions of 0.2 mm, which bring the variances to their least
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "kalman_core.h"
#include "kalman_core_params_defaults.h"
#include "axis3fSubSampler.h"
#include "mm_sweep_angles.h"
#include "mm_yaw_error.h"
#include "mm_position.h"
#include "mm_distance.h"
#include "mm_tdoa.h"
#include "mm_tof.h"
#include "lighthouse_position_est.h"
#include "lighthouse_geometry.h"
#include "estimator.h"
#include "physicalConstants.h"

static kalmanCoreData_t core;
static kalmanCoreParams_t params;

// What lighthouse_position_est.c calls.
pulseProcessor_t lighthouseCoreState;
static measurement_t queue[64];
static int queued = 0;
void estimatorEnqueue(const measurement_t *m) { queue[queued++] = *m; }
void estimatorKalmanGetEstimatedPos(point_t *p) { p->x = core.S[0]; p->y = core.S[1]; p->z = core.S[2]; }
void estimatorKalmanGetEstimatedRot(float *r) { memcpy(r, core.R, sizeof(core.R)); }
void assertFail(char *e, char *f, int l) { fprintf(stderr, "%s %s %d\n", e, f, l); exit(1); }
void memoryRegisterHandler(const void *h) { (void)h; }
void pulseProcessorClear(pulseProcessorResult_t *a, int b) { (void)a; (void)b; }

// Uniform and nearly normal numbers (splitmix64; four of them added).
static uint64_t state = 1;
static double uniform(void) {
  uint64_t z = (state += 0x9E3779B97F4A7C15ULL);
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
  return ((z ^ (z >> 31)) >> 11) / 9007199254740992.0;
}
static double normal(void) {
  double sum = 0;
  for (int i = 0; i < 4; i++) sum += uniform();
  return (sum - 2.0) * 1.7320508075688772;
}

static double hurry = 1;
// A sin^3(w t) with its first two derivatives.
static void bow(double a, double w, double t, double out[3]) {
  w *= hurry;
  double s = sin(w * t), c = cos(w * t), s3 = sin(3 * w * t), c3 = cos(3 * w * t);
  out[0] = a * (3 * s - s3) / 4;
  out[1] = a * w * (3 * c - 3 * c3) / 4;
  out[2] = a * w * w * (9 * s3 - 3 * s) / 4;
}
// Position, velocity and specific force plus drag in the world, and world from body: thrust along body z.
static void motion(double t, double p[3], double v[3], double f[3], double r[3][3]) {
  double x[3], y[3], z[3], psi[3];
  bow(0.5, 0.7, t, x); bow(0.3, 0.9, t, y); bow(0.3, 0.5, t, z); bow(0.3, 0.4, t, psi);
  double *axes[3] = {x, y, z}, thrust[3];
  for (int i = 0; i < 3; i++) {
    p[i] = axes[i][0] + (i == 2 ? 0.8 : 0);
    v[i] = axes[i][1];
    f[i] = axes[i][2] + (i == 2 ? 9.81 : 0);
    thrust[i] = f[i] + 0.45 * v[i];
  }
  double n = sqrt(thrust[0] * thrust[0] + thrust[1] * thrust[1] + thrust[2] * thrust[2]);
  double up[3] = {thrust[0] / n, thrust[1] / n, thrust[2] / n};
  double ahead[3] = {cos(psi[0]), sin(psi[0]), 0};
  // left = up x ahead, normalized; forward = left x up.
  double left[3] = {up[1] * ahead[2] - up[2] * ahead[1], up[2] * ahead[0] - up[0] * ahead[2], up[0] * ahead[1] - up[1] * ahead[0]};
  double m = sqrt(left[0] * left[0] + left[1] * left[1] + left[2] * left[2]);
  for (int i = 0; i < 3; i++) left[i] /= m;
  double forward[3] = {left[1] * up[2] - left[2] * up[1], left[2] * up[0] - left[0] * up[2], left[0] * up[1] - left[1] * up[0]};
  for (int i = 0; i < 3; i++) { r[i][0] = forward[i]; r[i][1] = left[i]; r[i][2] = up[i]; }
}

static const double PLACES[2][3] = {{-2.5, -2.2, 2.4}, {2.8, 2.2, 2.4}};
static const double TARGET[3] = {0.15, 0.0, 0.75};
static const double ANCHORS[8][3] = {{-2.5, -2.5, 0.2}, {-2.5, -2.5, 2.4}, {-2.5, 2.5, 0.2}, {-2.5, 2.5, 2.4},
                                     {2.5, -2.5, 0.2}, {2.5, -2.5, 2.4}, {2.5, 2.5, 0.2}, {2.5, 2.5, 2.4}};
static const double DECK[4][2] = {{-0.015, 0.0075}, {-0.015, -0.0075}, {0.015, 0.0075}, {0.015, -0.0075}};

int main(int argc, char **argv) {
  const char *kind = argc > 1 ? argv[1] : "sweeps";
  const int ticks = !strcmp(kind, "sweeps") ? 10000 : 5000;
  const int tilts = !strcmp(kind, "tilts"), precise = !strcmp(kind, "precise");
  const int twoWay = tilts || !strcmp(kind, "ranges");
  const double placeSigma = precise ? 0.0002 : 0.01;
  if (tilts) hurry = 2;
  params = (kalmanCoreParams_t){KALMAN_CORE_DEFAULT_PARAMS_INIT};
  params.stdDevInitialPosition_xy = params.stdDevInitialPosition_z = 0.02;
  params.stdDevInitialVelocity = 0.01;
  params.stdDevInitialAttitude_rollpitch = params.stdDevInitialAttitude_yaw = 0.02;
  params.initialZ = 0.8;
  params.attitudeReversion = 0;
  kalmanCoreInit(&core, &params, 0);
  Axis3fSubSampler_t acc, gyro;
  axis3fSubSamplerInit(&acc, 1);
  axis3fSubSamplerInit(&gyro, 1);
  OutlierFilterLhState_t lh; outlierFilterLighthouseReset(&lh, 0);
  OutlierFilterTdoaState_t td; outlierFilterTdoaReset(&td);

  static pulseProcessor_t pulse;
  static pulseProcessorResult_t angles;
  angles.measurementType = lighthouseBsTypeV2;
  double rot[2][3][3];
  for (int b = 0; b < 2; b++) {
    double d[3]; for (int i = 0; i < 3; i++) d[i] = TARGET[i] - PLACES[b][i];
    double yaw = atan2(d[1], d[0]), pitch = -atan2(d[2], hypot(d[0], d[1]));
    double cy = cos(yaw), sy = sin(yaw), cp = cos(pitch), sp = sin(pitch);
    double m[3][3] = {{cy * cp, -sy, cy * sp}, {sy * cp, cy, sy * sp}, {-sp, 0, cp}};
    memcpy(rot[b], m, sizeof(m));
    for (int i = 0; i < 3; i++) { pulse.bsGeometry[b].origin[i] = PLACES[b][i]; for (int j = 0; j < 3; j++) pulse.bsGeometry[b].mat[i][j] = m[i][j]; }
    pulse.bsGeometry[b].valid = true;
    for (int i = 0; i < 3; i++) for (int j = 0; j < 3; j++) pulse.bsGeoCache[b].baseStationInvertedRotationMatrixes[i][j] = m[j][i];
  }
  const double hz[2] = {48e6 / 959000, 48e6 / 957000}, phase[2] = {0.3, 0.75};
  long passed[2] = {0, 0}, heard[2] = {-1, -1}, pairs = 0, ranges = 0;
  double first[2][4];
  uint32_t nextPrediction = 0;

  for (int k = 0; k < ticks; k++) {
    const double t = k * 0.002, h = 1e-4;
    double p[3], v[3], f[3], r[3][3], pa[3], va[3], fa[3], ra[3][3], rb[3][3];
    motion(t - h, pa, va, fa, rb); motion(t + h, pa, va, fa, ra); motion(t, p, v, f, r);
    double w[3][3];
    for (int i = 0; i < 3; i++) for (int j = 0; j < 3; j++) {
      w[i][j] = 0; for (int l = 0; l < 3; l++) w[i][j] += r[l][i] * (ra[l][j] - rb[l][j]) / (2 * h); }
    double rate[3] = {w[2][1], w[0][2], w[1][0]}, force[3];
    for (int i = 0; i < 3; i++) force[i] = r[0][i] * f[0] + r[1][i] * f[1] + r[2][i] * f[2];
    Axis3f g, a;
    for (int i = 0; i < 3; i++) g.axis[i] = rate[i] + 0.004 * normal();
    for (int i = 0; i < 3; i++) a.axis[i] = force[i] + 0.03 * normal();

    // The deck's task, before the pass of the filter.
    queued = 0;
    if (!strcmp(kind, "sweeps")) for (int b = 0; b < 2; b++) for (;;) {
      const int plane = passed[b] % 2; const long turn = passed[b] / 2;
      if (turn + phase[b] + plane / 3.0 > t * hz[b]) break;
      passed[b]++;
      double measured[4];
      const double shared = 2e-4 * normal();
      for (int s = 0; s < 4; s++) {
        double d[3], u[3];
        for (int i = 0; i < 3; i++) d[i] = p[i] + r[i][0] * DECK[s][0] + r[i][1] * DECK[s][1] - PLACES[b][i];
        for (int i = 0; i < 3; i++) u[i] = rot[b][0][i] * d[0] + rot[b][1][i] * d[1] + rot[b][2][i] * d[2];
        const double lead = u[2] * (plane ? 0.5773502691896258 : -0.5773502691896258) / sqrt(u[0] * u[0] + u[1] * u[1]);
        measured[s] = atan2(u[1], u[0]) + asin(lead) + shared + 1e-4 * normal();
      }
      if (uniform() < 0.13) continue;
      if (plane == 0) { memcpy(first[b], measured, sizeof(measured)); heard[b] = turn; continue; }
      if (heard[b] != turn) continue;
      if (pairs++ % 2) continue;
      for (int s = 0; s < 4; s++) {
        pulseProcessorSensorMeasurement_t *two = &angles.baseStationMeasurementsLh2[b].sensorMeasurements[s];
        pulseProcessorSensorMeasurement_t *one = &angles.baseStationMeasurementsLh1[b].sensorMeasurements[s];
        two->angles[0] = two->correctedAngles[0] = first[b][s];
        two->angles[1] = two->correctedAngles[1] = measured[s];
        two->validCount = one->validCount = 2;
        const float *c = two->correctedAngles;
        one->correctedAngles[0] = (c[0] + c[1]) / 2;
        one->correctedAngles[1] = atan2f(sinf(c[1] - c[0]), 0.5773502691896258f * (cosf(c[0]) + cosf(c[1])));
      }
      lighthousePositionEstimatePoseSweeps(&pulse, &angles, b);
    }

    const uint32_t ms = 2 * k;
    if (ms >= nextPrediction) {
      axis3fSubSamplerFinalize(&acc); axis3fSubSamplerFinalize(&gyro);
      kalmanCorePredict(&core, &params, &acc.subSample, &gyro.subSample, ms, true);
      nextPrediction = ms + 10;
    }
    kalmanCoreAddProcessNoise(&core, &params, ms);
    for (int i = 0; i < queued; i++) {
      if (queue[i].type == MeasurementTypeSweepAngle) kalmanCoreUpdateWithSweepAngles(&core, &queue[i].data.sweepAngle, ms, &lh);
      if (queue[i].type == MeasurementTypeYawError) kalmanCoreUpdateWithYawError(&core, &queue[i].data.yawError);
    }
    if ((precise || !strcmp(kind, "positions")) && k % 10 == 0) {
      positionMeasurement_t m = {.stdDev = placeSigma};
      for (int i = 0; i < 3; i++) m.pos[i] = p[i] + 0.3 * placeSigma * normal();
      kalmanCoreUpdateWithPosition(&core, &m);
    }
    if ((twoWay || !strcmp(kind, "differences")) && k % 3 == 0) {
      const double *a0 = ANCHORS[ranges % 8], *a1 = ANCHORS[(ranges + 1) % 8];
      double d0 = 0, d1 = 0;
      for (int i = 0; i < 3; i++) { d0 += (p[i] - a0[i]) * (p[i] - a0[i]); d1 += (p[i] - a1[i]) * (p[i] - a1[i]); }
      const double astray = ranges % 10 == 9 ? 1.0 : 0.0, noise = 0.06 * normal();
      ranges++;
      if (twoWay) {
        distanceMeasurement_t m = {.x = a0[0], .y = a0[1], .z = a0[2], .distance = sqrt(d0) + noise + astray, .stdDev = 0.25};
        kalmanCoreUpdateWithDistance(&core, &m);
      } else {
        // distanceDiff is that to the second anchor less that to the first.
        tdoaMeasurement_t m = {.distanceDiff = sqrt(d0) - sqrt(d1) + noise + astray, .stdDev = 0.15};
        for (int i = 0; i < 3; i++) { (&m.anchorPositions[1].x)[i] = a0[i]; (&m.anchorPositions[0].x)[i] = a1[i]; }
        kalmanCoreUpdateWithTdoa(&core, &m, ms, &td);
      }
    }
    if (twoWay && k % 12 == 0) {
      tofMeasurement_t m = {.distance = p[2] / r[2][2] + 0.0025 * normal()};
      m.stdDev = 0.0025 * (1 + exp(2.9213510897825874 * (m.distance - 2.5)));
      kalmanCoreUpdateWithTof(&core, &m);
    }
    axis3fSubSamplerAccumulate(&acc, &a); axis3fSubSamplerAccumulate(&gyro, &g);
    kalmanCoreFinalize(&core);
    if (k % 100 == 99) {
      const float *q = core.q;
      printf("%d", k);
      for (int i = 0; i < 6; i++) printf(" %.5f", core.S[i]);
      printf(" %.4f %.4f %.4f", atan2f(2 * (q[1] * q[2] + q[0] * q[3]), q[0] * q[0] + q[1] * q[1] - q[2] * q[2] - q[3] * q[3]) * 57.29578f,
             asinf(-2 * (q[1] * q[3] - q[0] * q[2])) * 57.29578f, atan2f(2 * (q[2] * q[3] + q[0] * q[1]), q[0] * q[0] - q[1] * q[1] - q[2] * q[2] + q[3] * q[3]) * 57.29578f);
      for (int i = 0; i < 9; i++) printf(" %.4g", sqrt(core.P[i][i]));
      printf("\n");
    }
    // The pass between two ticks.
    kalmanCoreAddProcessNoise(&core, &params, ms + 1);
    kalmanCoreFinalize(&core);
  }
  return 0;
}
