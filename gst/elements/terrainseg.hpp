// SPDX-License-Identifier: LGPL-2.1-or-later
// The element `terrainseg`: learns the ground in front of the rover and attaches what it knows to every
// frame.
#pragma once

#include <gst/base/gstbasetransform.h>

G_BEGIN_DECLS
GST_ELEMENT_REGISTER_DECLARE(terrainseg)
G_END_DECLS
