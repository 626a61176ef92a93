// SPDX-License-Identifier: LGPL-2.1-or-later
#include "painter.hpp"

namespace terrainseg {

void paint(const MutableFrame&, const Estimate&, const PaintStyle&) {}

} // namespace terrainseg
