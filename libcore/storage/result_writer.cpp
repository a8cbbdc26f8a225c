#include "storage/result_writer.hpp"

#include <fmt/format.h>

#include <charconv>

#include "base/error.hpp"
#include "parallel/agreement.hpp"
#include "storage/atomic_file.hpp"
#include "storage/grid_image.hpp"
#include "storage/h5_file.hpp"

namespace malleus {
namespace {

constexpr int most_files_per_step = 64;
constexpr int image_tag = 81;
constexpr std::string_view step_mark = "<!-- increment ";
constexpr std::string_view head =
    "<?xml version=\"1.0\" ?>\n<!DOCTYPE Xdmf SYSTEM \"Xdmf.dtd\" []>\n<Xdmf Version=\"3.0\">\n<Domain>\n"
    "<Grid Name=\"results\" GridType=\"Collection\" CollectionType=\"Temporal\">\n";
constexpr std::string_view tail = "</Grid>\n</Domain>\n</Xdmf>\n";

int ranks_per_file(const Communicator& comm) {
  return (comm.size() + most_files_per_step - 1) / most_files_per_step;
}

template <class T>
void write_grid(H5File& file, const GridImage& image) {
  const std::string group = fmt::format("/p{:04d}", image.rank);
  const auto write = [&](const std::string& name, const std::vector<double>& values, std::uint64_t columns) {
    const std::vector<T> converted(values.begin(), values.end());
    std::vector<std::uint64_t> dims = {converted.size() / columns};
    if (columns > 1) dims.push_back(columns);
    file.write(group + "/" + name, std::span<const T>(converted), dims);
  };
  file.make_group(group);
  write("points", image.points, 3);
  file.write(group + "/cells", std::span<const std::int32_t>(image.cells),
             {image.cell_count(), static_cast<std::uint64_t>(image.dim) + 1});
  for (const GridAttribute& attribute : image.attributes) {
    write(attribute.name, attribute.values, static_cast<std::uint64_t>(attribute.components));
  }
}

/// Bytes from a member of the group of ranks that share a file. Long messages go in pieces.
void send_bytes(MPI_Comm comm, int to, const std::vector<std::byte>& bytes) {
  constexpr std::size_t piece = std::size_t{1} << 30;
  const std::uint64_t size = bytes.size();
  MPI_Send(&size, 1, MPI_UINT64_T, to, image_tag, comm);
  for (std::size_t at = 0; at < bytes.size(); at += piece) {
    MPI_Send(bytes.data() + at, static_cast<int>(std::min(piece, bytes.size() - at)), MPI_BYTE, to, image_tag, comm);
  }
}

std::vector<std::byte> receive_bytes(MPI_Comm comm, int from) {
  constexpr std::size_t piece = std::size_t{1} << 30;
  std::uint64_t size = 0;
  MPI_Recv(&size, 1, MPI_UINT64_T, from, image_tag, comm, MPI_STATUS_IGNORE);
  std::vector<std::byte> bytes(size);
  for (std::size_t at = 0; at < bytes.size(); at += piece) {
    MPI_Recv(bytes.data() + at, static_cast<int>(std::min(piece, bytes.size() - at)), MPI_BYTE, from, image_tag, comm,
             MPI_STATUS_IGNORE);
  }
  return bytes;
}

}  // namespace

ResultWriter::ResultWriter(const Communicator& comm, std::filesystem::path directory, std::string name,
                           Precision precision)
    : comm_(comm), directory_(std::move(directory)), name_(std::move(name)), precision_(precision) {}

void ResultWriter::start_anew() {
  steps_.clear();
  on_root(comm_, [&] {
    make_directories(directory_);
    std::error_code ignored;
    std::filesystem::remove(directory_ / (name_ + ".xdmf"), ignored);
    std::filesystem::remove_all(fields_directory(), ignored);
    make_directories(fields_directory());
  });
}

void ResultWriter::resume_after(GlobalId last_increment) {
  steps_.clear();
  on_root(comm_, [&] {
    make_directories(fields_directory());
    const std::filesystem::path index = directory_ / (name_ + ".xdmf");
    if (!std::filesystem::exists(index)) return;
    const std::string text = read_text_file(index);
    for (std::size_t at = text.find(step_mark); at != std::string::npos;) {
      const std::size_t next = text.find(step_mark, at + 1);
      GlobalId increment = 0;
      std::from_chars(text.data() + at + step_mark.size(), text.data() + text.size(), increment);
      const std::size_t end = next == std::string::npos ? text.rfind(tail) : next;
      if (increment <= last_increment) steps_.push_back({increment, text.substr(at, end - at)});
      at = next;
    }
    write_index();
  });
}

void ResultWriter::write(GlobalId increment, Real time, const Mesh& mesh, const std::vector<const Field*>& fields) {
  const int group_size = ranks_per_file(comm_);
  const int leader = comm_.rank() / group_size * group_size;
  const int float_bytes = precision_ == Precision::float32 ? 4 : 8;
  const GridImage mine = make_grid_image(comm_.rank(), mesh, fields);
  std::vector<GridImage> images;
  if (comm_.rank() != leader) {
    send_bytes(comm_.raw(), leader, pack_grid_image(mine));
  } else {
    images.push_back(mine);
    for (int rank = leader + 1; rank < std::min(leader + group_size, comm_.size()); ++rank) {
      images.push_back(unpack_grid_image(receive_bytes(comm_.raw(), rank)));
    }
  }
  std::erase_if(images, [](const GridImage& image) { return image.cells.empty(); });

  std::string grids;
  agree(comm_, [&] {
    if (images.empty()) return;
    const std::string file_name = fmt::format("s{:06d}.r{:04d}.h5", increment, leader);
    H5File file(fields_directory() / file_name, H5File::Mode::create_checked);
    for (const GridImage& image : images) {
      precision_ == Precision::float32 ? write_grid<float>(file, image) : write_grid<double>(file, image);
      grids += grid_xml(image, fmt::format("{}.fields/{}", name_, file_name), float_bytes);
    }
    file.close();
    flush_to_disk(fields_directory() / file_name);
    bytes_written_ += static_cast<GlobalId>(std::filesystem::file_size(fields_directory() / file_name));
  });
  const std::vector<std::string> all = comm_.gather_to_root(grids);
  on_root(comm_, [&] {
    std::string xml = fmt::format(
        "{}{} -->\n<Grid Name=\"s{:06d}\" GridType=\"Collection\" CollectionType=\"Spatial\">\n<Time "
        "Value=\"{:.17g}\"/>\n",
        step_mark, increment, increment, time);
    for (const std::string& part : all) xml += part;
    std::erase_if(steps_, [&](const Step& step) { return step.increment >= increment; });
    steps_.push_back({increment, xml + "</Grid>\n"});
    write_index();
  });
}

void ResultWriter::write_index() const {
  std::string text(head);
  for (const Step& step : steps_) text += step.xml;
  text += tail;
  write_file_atomically(directory_ / (name_ + ".xdmf"), text);
}

}  // namespace malleus
