// SPDX-License-Identifier: LGPL-2.1-or-later
// Marks the symbols that the shared library exports.
#pragma once

#define TERRAINSEG_API __attribute__((visibility("default")))
