#include "capture/calibration/xml_elements.h"

#include <cstddef>

namespace haustra::capture::internal {
namespace {

bool IsSpace(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

bool IsNameCharacter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
         c == '.' || c == ':';
}

class Parser {
 public:
  Parser(const std::string& path, std::string_view text) : path_(path), text_(text) {}

  Result<std::vector<XmlElement>> Run() {
    while (position_ < text_.size()) {
      if (text_[position_] != '<') {
        const char c = Take();
        if (!open_.empty()) {
          elements_[open_.back()].text += c;
        } else if (!IsSpace(c)) {
          return Error("text outside of any element");
        }
      } else if (StartsWith("<!--")) {
        HAUSTRA_TRY(SkipPast("-->", "comment"));
      } else if (StartsWith("<?")) {
        HAUSTRA_TRY(SkipPast("?>", "declaration"));
      } else if (StartsWith("<!")) {
        return Error("'<!' other than a comment is not supported");
      } else if (StartsWith("</")) {
        HAUSTRA_TRY(CloseElement());
      } else {
        HAUSTRA_TRY(OpenElement());
      }
    }
    if (!open_.empty()) return Error("the file ends inside <" + elements_[open_.back()].name + ">");
    if (elements_.empty()) return Error("no element");
    return std::move(elements_);
  }

 private:
  bool StartsWith(std::string_view word) const { return text_.substr(position_).starts_with(word); }

  char Take() {
    const char c = text_[position_++];
    if (c == '\n') ++line_;
    return c;
  }

  void SkipSpace() {
    while (position_ < text_.size() && IsSpace(text_[position_])) Take();
  }

  std::string TakeName() {
    std::string name;
    while (position_ < text_.size() && IsNameCharacter(text_[position_])) name += Take();
    return name;
  }

  Status Error(const std::string& what) const {
    return InvalidArgument(path_ + ":" + std::to_string(line_) + ": not valid XML: " + what);
  }

  Status SkipPast(std::string_view end, const std::string& what) {
    const std::size_t found = text_.find(end, position_);
    if (found == std::string_view::npos) return Error("a " + what + " does not end");
    while (position_ < found + end.size()) Take();
    return Status::Ok();
  }

  Status OpenElement() {
    XmlElement element;
    element.line = line_;
    Take();  // '<'
    element.name = TakeName();
    if (element.name.empty()) return Error("'<' without a name");
    for (;;) {
      SkipSpace();
      if (StartsWith("/>")) {
        position_ += 2;
        elements_.push_back(std::move(element));
        return Status::Ok();
      }
      if (StartsWith(">")) {
        Take();
        open_.push_back(elements_.size());
        elements_.push_back(std::move(element));
        return Status::Ok();
      }
      HAUSTRA_TRY(TakeAttribute(&element));
    }
  }

  Status TakeAttribute(XmlElement* element) {
    const std::string name = TakeName();
    SkipSpace();
    if (name.empty() || !StartsWith("=")) return Error("<" + element->name + "> is not closed or has a bad attribute");
    Take();
    SkipSpace();
    if (!StartsWith("\"") && !StartsWith("'")) return Error("the value of attribute '" + name + "' is not in quotes");
    const char quote = Take();
    std::string value;
    while (position_ < text_.size() && text_[position_] != quote) value += Take();
    if (position_ == text_.size()) return Error("the value of attribute '" + name + "' does not end");
    Take();
    element->attributes.emplace_back(name, std::move(value));
    return Status::Ok();
  }

  Status CloseElement() {
    position_ += 2;
    const std::string name = TakeName();
    SkipSpace();
    if (!StartsWith(">")) return Error("</" + name + " is not closed");
    Take();
    if (open_.empty() || elements_[open_.back()].name != name) return Error("</" + name + "> closes nothing");
    open_.pop_back();
    return Status::Ok();
  }

  const std::string& path_;
  std::string_view text_;
  std::size_t position_ = 0;
  int line_ = 1;
  std::vector<XmlElement> elements_;
  std::vector<std::size_t> open_;  // indices, outermost first
};

}  // namespace

std::string XmlElement::Attribute(std::string_view attribute) const {
  for (const auto& [key, value] : attributes) {
    if (key == attribute) return value;
  }
  return {};
}

Result<std::vector<XmlElement>> ParseXml(const std::string& path, std::string_view text) {
  return Parser(path, text).Run();
}

}  // namespace haustra::capture::internal
