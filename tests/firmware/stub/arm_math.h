#pragma once
#include <stdint.h>
#include <math.h>
#include <string.h>
#include <stdbool.h>
#ifndef PI
#define PI 3.14159265358979f
#endif
typedef float float32_t;
typedef enum { ARM_MATH_SUCCESS = 0, ARM_MATH_ARGUMENT_ERROR = -1 } arm_status;
typedef struct { uint16_t numRows; uint16_t numCols; float32_t *pData; } arm_matrix_instance_f32;
static inline arm_status arm_mat_trans_f32(const arm_matrix_instance_f32 *a, arm_matrix_instance_f32 *b) {
  for (int i = 0; i < a->numRows; i++) for (int j = 0; j < a->numCols; j++)
    b->pData[j * a->numRows + i] = a->pData[i * a->numCols + j];
  return ARM_MATH_SUCCESS;
}
static inline arm_status arm_mat_mult_f32(const arm_matrix_instance_f32 *a, const arm_matrix_instance_f32 *b, arm_matrix_instance_f32 *c) {
  float out[81];
  int n = a->numRows, m = b->numCols, k = a->numCols;
  for (int i = 0; i < n; i++) for (int j = 0; j < m; j++) {
    float s = 0; for (int l = 0; l < k; l++) s += a->pData[i * k + l] * b->pData[l * m + j];
    out[i * m + j] = s;
  }
  memcpy(c->pData, out, sizeof(float) * n * m);
  return ARM_MATH_SUCCESS;
}
static inline arm_status arm_mat_inverse_f32(const arm_matrix_instance_f32 *a, arm_matrix_instance_f32 *b) { (void)a; (void)b; return ARM_MATH_ARGUMENT_ERROR; }
static inline arm_status arm_mat_scale_f32(const arm_matrix_instance_f32 *a, float s, arm_matrix_instance_f32 *b) {
  for (int i = 0; i < a->numRows * a->numCols; i++) b->pData[i] = a->pData[i] * s; return ARM_MATH_SUCCESS; }
static inline arm_status arm_sqrt_f32(float x, float *o) { *o = x < 0 ? 0 : sqrtf(x); return ARM_MATH_SUCCESS; }
static inline float arm_sin_f32(float x) { return sinf(x); }
static inline float arm_cos_f32(float x) { return cosf(x); }
static inline void arm_sub_f32(const float *a, const float *b, float *c, uint32_t n) { for (uint32_t i = 0; i < n; i++) c[i] = a[i] - b[i]; }
static inline void arm_add_f32(const float *a, const float *b, float *c, uint32_t n) { for (uint32_t i = 0; i < n; i++) c[i] = a[i] + b[i]; }
static inline void arm_scale_f32(const float *a, float s, float *c, uint32_t n) { for (uint32_t i = 0; i < n; i++) c[i] = a[i] * s; }
static inline void arm_dot_prod_f32(const float *a, const float *b, uint32_t n, float *c) { float s = 0; for (uint32_t i = 0; i < n; i++) s += a[i] * b[i]; *c = s; }
