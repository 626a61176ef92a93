// SPDX-License-Identifier: LGPL-2.1-or-later
#include "ros2/outlet.hpp"

#include <glib.h>

#include "ros2/names.hpp"

namespace terrainseg::ros2 {

using recording::Topic;

void Outlet::open(Topic topic, const std::string& name) {
  check_name(name);
  const bool late = topic == Topic::grid || topic == Topic::tf_static;
  // A decoder needs every picture.
  const int depth = late ? 1 : topic == Topic::video ? 30 : 5;
  writers_[static_cast<std::size_t>(topic)] =
      std::make_unique<Writer>(participant_, name, recording::type_of(topic),
                               late ? Durability::transient_local : Durability::volatile_data, depth);
}

std::vector<dds_entity_t> Outlet::entities() const {
  std::vector<dds_entity_t> entities;
  for (const auto& writer : writers_)
    if (writer)
      entities.push_back(writer->entity());
  return entities;
}

bool Outlet::wants(Topic topic) {
  const Writer* open = writer(topic);
  if (!open)
    return false;
  if (topic == Topic::tf_static)
    return !sent_static_;
  if (topic == Topic::grid && open->readers() == 0)
    return !last_grid_ || g_get_monotonic_time() - *last_grid_ >= 2 * G_USEC_PER_SEC;
  return open->readers() > 0;
}

bool Outlet::put(Topic topic, std::uint64_t, recording::ByteView message) {
  const bool written = writers_[static_cast<std::size_t>(topic)]->write(message);
  if (topic == Topic::grid)
    last_grid_ = g_get_monotonic_time();
  if (topic == Topic::tf_static)
    sent_static_ = written;
  if (topic == Topic::tf)
    sent_static_ = false;
  return true;
}

} // namespace terrainseg::ros2
