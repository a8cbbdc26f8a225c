#include "field/field.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.hpp"

namespace malleus {
namespace {

template <class Fields>
auto find(Fields& fields, std::string_view name) {
  return std::find_if(fields.begin(), fields.end(), [&](const auto& field) { return field->spec().name == name; });
}

}  // namespace

Field& FieldStore::declare(const Mesh& mesh, const FieldSpec& spec) {
  check(spec.components > 0, "a field has components");
  if (const auto found = find(fields_, spec.name); found != fields_.end()) {
    check((*found)->spec() == spec, "a field is declared alike everywhere");
    return **found;
  }
  fields_.push_back(std::unique_ptr<Field>(new Field(spec)));
  fields_.back()->values_.assign(entities(mesh, spec.support) * static_cast<std::size_t>(spec.components), 0.0);
  return *fields_.back();
}

bool FieldStore::has(std::string_view name) const {
  return find(fields_, name) != fields_.end();
}

Field& FieldStore::operator[](std::string_view name) {
  const auto found = find(fields_, name);
  if (found != fields_.end()) return **found;
  std::string known;
  for (const auto& field : fields_) known += " " + field->spec().name;
  throw Defect(fmt::format("there is no field '{}' among:{}", name, known), std::source_location::current());
}

const Field& FieldStore::operator[](std::string_view name) const {
  return const_cast<FieldStore&>(*this)[name];
}

void FieldStore::remove(std::string_view name) {
  if (const auto found = find(fields_, name); found != fields_.end()) fields_.erase(found);
}

std::vector<Field*> FieldStore::all() {
  std::vector<Field*> list;
  for (const auto& field : fields_) list.push_back(field.get());
  return list;
}

std::vector<const Field*> FieldStore::all() const {
  std::vector<const Field*> list;
  for (const auto& field : fields_) list.push_back(field.get());
  return list;
}

std::size_t FieldStore::entities(const Mesh& mesh, Support support) {
  switch (support) {
    case Support::domain:
      return 1;
    case Support::element:
      return static_cast<std::size_t>(mesh.elements());
    case Support::node:
      return static_cast<std::size_t>(mesh.nodes());
  }
  return 0;
}

}  // namespace malleus
