// SPDX-License-Identifier: LGPL-2.1-or-later
// The element `terrainscenesrc`: a rendered rover's view with its truth as metadata.
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS
GST_ELEMENT_REGISTER_DECLARE(terrainscenesrc)
G_END_DECLS
