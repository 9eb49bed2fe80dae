#pragma once

namespace calipso {

// Whether two messages with a header say the same. What is sent once can come twice, to a
// subscriber that connects while it is published, and the transport numbers each sending anew.
template <class Message>
bool sameMessage(Message a, const Message& b) {
  a.header.seq = b.header.seq;
  return a == b;
}

}  // namespace calipso
