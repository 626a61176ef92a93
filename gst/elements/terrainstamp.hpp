// SPDX-License-Identifier: LGPL-2.1-or-later
// The element `terrainstamp`: the precision time of each picture in encoded video.
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS
GST_ELEMENT_REGISTER_DECLARE(terrainstamp)
G_END_DECLS
