// SPDX-License-Identifier: LGPL-2.1-or-later
// Marks what the shared library shows.
#pragma once

#define TERRAINSEG_API __attribute__((visibility("default")))
