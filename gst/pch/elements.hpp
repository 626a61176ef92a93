// SPDX-License-Identifier: LGPL-2.1-or-later
// Compiled once for all sources of a plugin; without it (-Db_pch=false) every source has what it needs.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <gst/base/gstbasetransform.h>
#include <gst/gst.h>
#include <gst/video/video.h>
