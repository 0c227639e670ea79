#pragma once
typedef struct { int x; } statsCntRateLogger_t;
#define STATS_CNT_RATE_DEFINE(n, i) statsCntRateLogger_t n
#define STATS_CNT_RATE_EVENT(x) ((void)(x))
#define STATS_CNT_RATE_EVENT_DEBUG(x) ((void)(x))
