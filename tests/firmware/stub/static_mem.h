#pragma once
#define NO_DMA_CCM_SAFE_ZERO_INIT
