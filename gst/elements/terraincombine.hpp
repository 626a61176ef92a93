// SPDX-License-Identifier: LGPL-2.1-or-later
// The element `terraincombine`: video and KLV units back to video with the metadata.
#pragma once

#include <gst/gst.h>

G_BEGIN_DECLS
GST_ELEMENT_REGISTER_DECLARE(terraincombine)
G_END_DECLS
