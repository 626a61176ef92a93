// SPDX-License-Identifier: LGPL-2.1-or-later
// Definitions of the types that messages are composed of, as text.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>

namespace terrainseg::recording {

/// The short name of a type, package/Name, and its members.
struct Definition {
  const char* name;
  const char* members;
};

inline constexpr Definition time_type{"builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"};
inline constexpr Definition header_type{"std_msgs/Header",
                                        "builtin_interfaces/Time stamp\nstring frame_id\n"};
inline constexpr Definition vector_type{"geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"};
inline constexpr Definition quaternion_type{"geometry_msgs/Quaternion",
                                            "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"};
inline constexpr Definition point_type{"geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"};
inline constexpr Definition pose_type{"geometry_msgs/Pose",
                                      "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"};

/// The members, then each part after a line of 80 equals signs and its name.
inline std::string schema(const char* members, std::initializer_list<Definition> parts) {
  std::string text = members;
  for (const Definition& part : parts)
    text.append(80, '=').append("\nMSG: ").append(part.name).append("\n").append(part.members);
  return text;
}

inline constexpr std::uint64_t second = 1'000'000'000; ///< nanoseconds

} // namespace terrainseg::recording
