#pragma once
#include <assert.h>
#define ASSERT(x) ((void)0)
