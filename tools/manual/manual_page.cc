#include "tools/manual/manual_page.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <set>

namespace haustra::manual {
namespace {

// Text as roff takes it: no escapes, no requests, no hyphens that are minus signs.
std::string Roff(const std::string& text) {
  std::string roff;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool begins_line = i == 0 || text[i - 1] == '\n';
    if (begins_line && (text[i] == '.' || text[i] == '\'')) roff += "\\&";
    switch (text[i]) {
      case '\\': roff += "\\e"; break;
      case '-': roff += "\\-"; break;
      default: roff += text[i];
    }
  }
  return roff;
}

// As a paragraph; lines that the text breaks itself stay apart.
std::string Paragraph(const std::string& text) {
  std::string roff;
  bool begins_line = false;
  for (const char c : Roff(text)) {
    if (begins_line && c == ' ') continue;  // a blank at the beginning of a line means something to roff
    begins_line = c == '\n';
    if (begins_line) roff += "\n.br";
    roff += c;
  }
  return roff + "\n";
}

std::string Header(const std::string& name, int section, const std::string& version) {
  std::string title = name;
  std::transform(title.begin(), title.end(), title.begin(), [](unsigned char c) { return std::toupper(c); });
  return ".\\\" Made from the program's own tables; changes here are lost.\n.TH " + Roff(title) + " " +
         std::to_string(section) + " \"\" \"" + Roff(version) + "\" \"haustra\"\n";
}

std::string WithEnd(std::string text) {
  if (!text.empty() && text.back() != '.') text += '.';
  return text;
}

// "[0 - 256]" of "in [0 - 256]" as "0 to 256".
std::string RangeText(const std::string& check) {
  const std::size_t begin = check.find("in ["), end = check.find(']');
  if (begin == std::string::npos || end == std::string::npos) return {};
  std::string range = check.substr(begin + 4, end - begin - 4);
  if (const std::size_t dash = range.find(" - "); dash != std::string::npos) range.replace(dash, 3, " to ");
  return range;
}

std::string OptionsText(const CLI::App& command) {
  std::string text;
  for (const OptionText& option : OptionsOf(command)) {
    text += ".TP\n";
    text += (option.is_positional ? "\\fI" : "\\fB") + Roff(option.names) + "\\fR";
    if (!option.value.empty()) text += " \\fI" + Roff(option.value) + "\\fR";
    text += "\n" + Paragraph(option.description);
  }
  return text;
}

std::string SynopsisText(const CLI::App& command) {
  std::string text = "\\fB" + Roff(NameOf(command, ' ')) + "\\fR";
  if (!CommandsOf(command).empty()) return text + " \\fICOMMAND\\fR [\\fIOPTIONS\\fR]\n";
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_positional()) {
      const std::string name = "\\fI" + Roff(option->get_name(true)) + "\\fR";
      text += option->get_required() ? " " + name : " [" + name + "]";
    } else if (option->get_required()) {
      text += " \\fB" + Roff(option->get_name()) + "\\fR \\fIVALUE\\fR";
    }
  }
  return text + " [\\fIOPTIONS\\fR]\n";
}

// "Exit codes:" of the help, code by code.
std::string ExitText(const CLI::App& command) {
  std::string text;
  const std::string footer = command.get_footer();
  for (std::size_t at = footer.find('\n', footer.find("Exit codes:")); at != std::string::npos;) {
    const std::size_t end = footer.find('\n', at + 1);
    const std::string line = footer.substr(at + 1, end == std::string::npos ? end : end - at - 1);
    const std::size_t code = line.find_first_not_of(' '), blank = line.find(' ', code);
    if (code != std::string::npos && blank != std::string::npos) {
      text += ".TP\n.B " + line.substr(code, blank - code) + "\n" +
              Paragraph(line.substr(line.find_first_not_of(' ', blank)));
    }
    at = end;
  }
  return text;
}

}  // namespace

std::vector<const CLI::App*> CommandsOf(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

std::string NameOf(const CLI::App& command, char joint) {
  const CLI::App* parent = command.get_parent();
  return parent == nullptr ? command.get_name() : NameOf(*parent, joint) + joint + command.get_name();
}

std::vector<OptionText> OptionsOf(const CLI::App& command) {
  std::vector<OptionText> texts;
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_group().empty()) continue;  // not for users
    OptionText text;
    text.is_positional = option->get_positional();
    if (text.is_positional) {
      text.names = option->get_name(true);
    } else {
      for (const std::string& name : option->get_snames()) text.names += (text.names.empty() ? "-" : ", -") + name;
      for (const std::string& name : option->get_lnames()) text.names += (text.names.empty() ? "--" : ", --") + name;
    }
    text.description = WithEnd(option->get_description());
    const std::string type = option->get_items_expected_max() > 0 ? option->get_type_name() : std::string();
    const std::size_t colon = type.find(':');
    const std::string check = colon == std::string::npos ? std::string() : type.substr(colon + 1);
    if (check.starts_with('{')) {
      std::string choice;
      for (const char c : check.substr(1)) {
        if (c != ',' && c != '}') {
          choice += c;
          continue;
        }
        text.choices.push_back(choice);
        text.value += (text.value.empty() ? "" : "|") + choice;
        choice.clear();
        if (c == '}') break;
      }
    } else if (!text.is_positional) {
      text.value = type.substr(0, colon);
    }
    text.takes_many = option->get_items_expected_max() > 1;
    text.is_path = text.choices.empty() && type.substr(0, colon) == "TEXT";
    if (const std::string range = RangeText(check); !range.empty()) text.description += " From " + range + ".";
    if (const std::string value = option->get_default_str(); !value.empty()) {
      text.description += " Default: " + value + ".";
    }
    texts.push_back(std::move(text));
  }
  return texts;
}

std::string CommandPage(const CLI::App& command, int section, const std::string& version,
                        const std::vector<std::string>& see_also) {
  const std::string name = NameOf(command, '-');
  std::string page = Header(name, section, version);
  page += ".SH NAME\n" + Roff(name) + " \\- " + Roff(command.get_description()) + "\n";
  page += ".SH SYNOPSIS\n" + SynopsisText(command);
  page += ".SH DESCRIPTION\n" + Paragraph(WithEnd(command.get_description()));
  const std::vector<const CLI::App*> commands = CommandsOf(command);
  if (!commands.empty()) page += ".SH COMMANDS\n";
  for (const CLI::App* each : commands) {
    page += ".TP\n\\fB" + Roff(each->get_name()) + "\\fR\n" + Paragraph(WithEnd(each->get_description()));
  }
  page += ".SH OPTIONS\n" + OptionsText(command);
  // Commands below a command have no page of their own.
  for (const CLI::App* each : commands) {
    if (command.get_parent() == nullptr) break;
    page += ".SS " + Roff(NameOf(*each, ' ')) + "\n" + OptionsText(*each);
  }
  page += ".SH \"EXIT STATUS\"\n" + ExitText(command);
  page += ".SH \"SEE ALSO\"\n";
  for (std::size_t i = 0; i < see_also.size(); ++i) {
    const std::size_t bracket = see_also[i].find('(');
    page += ".BR " + Roff(see_also[i].substr(0, bracket)) + " " + see_also[i].substr(bracket) +
            (i + 1 < see_also.size() ? ",\n" : "\n");
  }
  return page;
}

std::string ConfigurationPage(const std::vector<ConfigField>& fields, const void* defaults,
                              const std::vector<ConfigField>& engine_fields, const std::string& version) {
  std::set<std::string> engine;
  for (const ConfigField& field : engine_fields) engine.insert(field.key);
  std::string page = Header("haustra.yaml", 5, version);
  page += ".SH NAME\nhaustra.yaml \\- configuration of haustra and haustrad\n.SH DESCRIPTION\n";
  page += Paragraph(
      "YAML: sections, and in each a line 'key: value'. Every key has a default, and an unknown key, a value of the "
      "wrong type or one out of range is refused with file, line and what is allowed.");
  page +=
      ".PP\n" +
      Paragraph(
          "The same keys are set on the command line as --set section.key=value. A file may begin with 'preset: FILE', "
          "whose values apply first.");
  page +=
      ".PP\n.B haustra run \\-\\-print\\-config\nand\n.B haustrad \\-\\-print\\-config\nprint all keys with the "
      "origin of each value.\n";
  page += ".SH KEYS\n";
  std::string section;
  for (const ConfigField& field : fields) {
    const std::size_t dot = field.key.rfind('.');
    const std::string own = dot == std::string::npos ? std::string() : field.key.substr(0, dot);
    if (own != section) page += ".SS " + Roff(own) + "\n";
    section = own;
    page += ".TP\n\\fB" + Roff(field.key) + "\\fR\n";
    std::string text = WithEnd(field.description) + " Allowed: " + field.Allowed();
    if (!field.unit.empty()) text += ", in " + field.unit;
    text += ". Default: ";
    const std::string value = ToText(field.read(defaults));
    text += (value.empty() ? "empty" : value) + ".";
    if (!engine.contains(field.key)) text += " Read by haustrad only.";
    if (field.reload == ConfigReload::kLive) text += " Takes effect at a reload of the service.";
    page += Paragraph(text);
  }
  page += ".SH FILES\n.TP\n.I /etc/haustra/haustra.yaml\nOf the service.\n";
  page += ".SH \"SEE ALSO\"\n.BR haustra (1),\n.BR haustra\\-run (1),\n.BR haustrad (8)\n";
  return page;
}

}  // namespace haustra::manual
