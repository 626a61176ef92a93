// SPDX-License-Identifier: LGPL-2.1-or-later
// Which of Highway's targets the kernels are compiled for; included before Highway.
#pragma once

// The target for SVE of exactly 32 bytes gives wrong three-byte pixels with GCC 12 (tests/ci/aarch64.sh found
// it); SVE of any length is right there and serves the same machines.
#ifdef TERRAINSEG_FEW_TARGETS // builds for checks of other things: the least, and AVX2; half the time to
                              // compile
#define HWY_DISABLED_TARGETS (HWY_SVE_256 | HWY_SSSE3 | HWY_SSE4 | HWY_AVX3)
#else
#define HWY_DISABLED_TARGETS HWY_SVE_256
#endif

// HWY_WANT_AVX3_DL is not asked for: on a processor that has it no kernel got faster (ratios to memcpy 3.46
// against 3.52 for the reduction, 10.58 against 10.60 for scoring).

/// Whether the target that is compiled right now looks values up in memory by a vector of indices, so that it
/// pays. For #if, behind Highway.
#define TERRAINSEG_GATHERS (HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3 || HWY_TARGET == HWY_AVX3_DL)
