// SPDX-License-Identifier: LGPL-2.1-or-later
// The category that all of the element's sources log and post under: GST_DEBUG=terrainseg:5.
#pragma once

#include <gst/gst.h>

GST_DEBUG_CATEGORY_EXTERN(terrainseg_debug);
#define GST_CAT_DEFAULT terrainseg_debug
