#pragma once

#include <ros/serialization.h>

#include <algorithm>

namespace calipso {

// Whether two messages with a header say the same, bit for bit: a number that is none (NaN) is not
// equal to itself. What is sent once can come twice, to a subscriber that connects while it is
// published, and the transport numbers each sending anew.
template <class Message>
bool sameMessage(Message a, const Message& b) {
  a.header.seq = b.header.seq;
  const ros::SerializedMessage of_a = ros::serialization::serializeMessage(a),
                               of_b = ros::serialization::serializeMessage(b);
  return std::equal(of_a.buf.get(), of_a.buf.get() + of_a.num_bytes,  //
                    of_b.buf.get(), of_b.buf.get() + of_b.num_bytes);
}

}  // namespace calipso
