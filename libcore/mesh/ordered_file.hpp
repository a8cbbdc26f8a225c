#pragma once

/// One file written by all ranks in rank order, through the root, without any rank holding all of it.

#include <fstream>
#include <string>

#include "parallel/communicator.hpp"

namespace malleus {

/// Every call is collective. The file is written beside its place and renamed by close(); where close() is not reached,
/// nothing is left. Failures are StorageErrors on all ranks.
class OrderedFile {
 public:
  OrderedFile(const Communicator& comm, std::string path);
  OrderedFile(const OrderedFile&) = delete;
  OrderedFile& operator=(const OrderedFile&) = delete;
  ~OrderedFile();

  /// The bytes of rank 0, then those of rank 1, and so on. The root receives them in blocks of some MiB.
  void append(const std::string& mine);
  /// The root's bytes alone; those of other ranks are not looked at.
  void append_from_root(const std::string& bytes);
  void close();

 private:
  void receive(int rank);

  const Communicator& comm_;
  std::string path_;
  std::string aside_;
  std::ofstream file_;
  bool is_open_ = false;
};

}  // namespace malleus
