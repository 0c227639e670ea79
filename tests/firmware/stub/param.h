#pragma once
#define PARAM_GROUP_START(x)
#define PARAM_GROUP_STOP(x)
#define PARAM_ADD(...)
#define PARAM_ADD_CORE(...)
#define PARAM_ADD_CORE_WITH_CALLBACK(...)
#define PARAM_ADD_WITH_CALLBACK(...)
#define PARAM_PERSISTENT 0
