#include "storage/field_list.hpp"

namespace malleus {

nlohmann::json describe_fields(const FieldStore& fields) {
  nlohmann::json list = nlohmann::json::array();
  for (const Field* field : fields.all()) {
    const FieldSpec& spec = field->spec();
    list.push_back({{"name", spec.name},
                    {"unit", spec.unit},
                    {"support", static_cast<int>(spec.support)},
                    {"components", spec.components},
                    {"transfer", static_cast<int>(spec.transfer)},
                    {"positive", spec.positive}});
  }
  return list;
}

std::vector<FieldSpec> field_specs(const nlohmann::json& list) {
  std::vector<FieldSpec> specs;
  for (const auto& entry : list) {
    specs.push_back({entry.at("name"), entry.at("unit"), static_cast<Support>(entry.at("support").get<int>()),
                     entry.at("components"), static_cast<Transfer>(entry.at("transfer").get<int>()),
                     entry.at("positive")});
  }
  return specs;
}

std::vector<Real> interleave_fields(const std::vector<FieldSpec>& specs, const std::vector<std::vector<Real>>& values,
                                    Support support, std::size_t entities) {
  std::vector<Real> rows;
  for (std::size_t i = 0; i < entities; ++i) {
    for (std::size_t f = 0; f < specs.size(); ++f) {
      if (specs[f].support != support) continue;
      const auto width = static_cast<std::size_t>(specs[f].components);
      const Real* first = values[f].data() + i * width;
      rows.insert(rows.end(), first, first + width);
    }
  }
  return rows;
}

}  // namespace malleus
