// SPDX-License-Identifier: LGPL-2.1-or-later
// The element `terrainreference`: the unmodified algorithm in a pipeline, beside `terrainseg`.
#pragma once

#include <gst/base/gstbasetransform.h>

G_BEGIN_DECLS
GST_ELEMENT_REGISTER_DECLARE(terrainreference)
G_END_DECLS
