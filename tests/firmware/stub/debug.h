#pragma once
#define DEBUG_PRINT(...)
