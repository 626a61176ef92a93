// SPDX-License-Identifier: LGPL-2.1-or-later
#include "exchange/vmti_codec.hpp"

#include <algorithm>

namespace terrainseg::vmti {

std::uint16_t checksum16(View bytes) {
  std::uint32_t high = 0, low = 0;
  std::size_t i = 0;
  for (; i + 1 < bytes.size(); i += 2) {
    high += bytes[i];
    low += bytes[i + 1];
  }
  if (i < bytes.size())
    high += bytes[i];
  return static_cast<std::uint16_t>((high << 8) + low);
}

void put_big(Bytes& out, std::uint64_t value, int bytes) {
  for (int i = bytes - 1; i >= 0; --i)
    out.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

namespace {

int bytes_of(std::uint64_t value) {
  int n = 1;
  while (n < 8 && (value >> (8 * n)) != 0)
    ++n;
  return n;
}

} // namespace

void put_length(Bytes& out, std::size_t length) {
  if (length < 128) {
    out.push_back(static_cast<std::uint8_t>(length));
    return;
  }
  const int n = bytes_of(length);
  out.push_back(static_cast<std::uint8_t>(0x80 | n));
  put_big(out, length, n);
}

void put_bytes(Bytes& out, View bytes) {
  out.insert(out.end(), bytes.begin(), bytes.end());
}

void put_head(Bytes& out, std::uint8_t tag, std::size_t length) {
  out.push_back(tag);
  put_length(out, length);
}

void put_item(Bytes& out, std::uint8_t tag, View value) {
  put_head(out, tag, value.size());
  put_bytes(out, value);
}

void put_text(Bytes& out, std::uint8_t tag, std::string_view text) {
  put_item(out, tag, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

void put_number(Bytes& out, std::uint8_t tag, std::uint64_t value, int bytes) {
  if (bytes == 0)
    bytes = bytes_of(value);
  out.push_back(tag);
  out.push_back(static_cast<std::uint8_t>(bytes));
  put_big(out, value, bytes);
}

void put_rectangle(Bytes& out, std::uint8_t tag, const Rectangle& r) {
  out.push_back(tag);
  out.push_back(16);
  for (const int v : {r.x, r.y, r.width, r.height})
    put_big(out, static_cast<std::uint32_t>(v), 4);
}

void put_boundary(Bytes& out, std::span<const std::uint16_t> boundary) {
  std::int32_t last = 0;
  for (const std::uint16_t row : boundary) {
    const std::int32_t step = row - last;
    std::uint32_t zigzag =
        step >= 0 ? static_cast<std::uint32_t>(step) * 2 : static_cast<std::uint32_t>(-step) * 2 - 1;
    for (; zigzag >= 128; zigzag >>= 7)
      out.push_back(static_cast<std::uint8_t>(zigzag | 128));
    out.push_back(static_cast<std::uint8_t>(zigzag));
    last = row;
  }
}

bool read_number(View item, std::uint64_t& value) {
  if (item.empty() || item.size() > 8)
    return false;
  value = Cursor(item).big(item.size());
  return true;
}

bool read_rectangle(View item, Rectangle& r) {
  if (item.size() != 16)
    return false;
  Cursor in(item);
  for (int* v : {&r.x, &r.y, &r.width, &r.height}) {
    *v = static_cast<std::int32_t>(static_cast<std::uint32_t>(in.big(4)));
    if (*v < -65536 || *v > 65536)
      return false;
  }
  return true;
}

bool read_boundary(View item, std::vector<std::uint16_t>& boundary) {
  boundary.clear();
  std::int32_t row = 0;
  for (std::size_t i = 0; i < item.size();) {
    std::uint32_t zigzag = 0;
    for (int shift = 0;; shift += 7) {
      if (i == item.size() || shift > 14)
        return false;
      const std::uint8_t b = item[i++];
      zigzag |= (b & 127u) << shift;
      if (b < 128)
        break;
    }
    row +=
        (zigzag & 1) ? -static_cast<std::int32_t>((zigzag + 1) >> 1) : static_cast<std::int32_t>(zigzag >> 1);
    if (row < 0 || row > 65535)
      return false;
    boundary.push_back(static_cast<std::uint16_t>(row));
  }
  return true;
}

bool begins_with(View bytes, const std::array<std::uint8_t, 16>& label) {
  return bytes.size() >= label.size() && std::equal(label.begin(), label.end(), bytes.begin());
}

} // namespace terrainseg::vmti
