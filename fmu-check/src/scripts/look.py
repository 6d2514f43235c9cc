import re
import sys
import zipfile

from fmpy.validation import validate_fmu


def main():
    path = sys.argv[1] if len(sys.argv) > 1 else FILE
    with zipfile.ZipFile(path) as archive:
        entries = archive.infolist()
        lines = archive.read("modelDescription.xml").decode("utf-8", "replace").split("\n")
    for text in EVIDENCE:
        print(f"fmu check found: {text}")
        for number in map(int, re.findall(r"\bline (\d+)", text)):
            if 0 < number <= len(lines):
                print(f"  modelDescription.xml:{number}: {lines[number - 1].strip()}")
        for entry in entries:
            if entry.filename in text:
                print(f"  {entry.filename}: {entry.file_size} bytes, method {entry.compress_type}, flags {entry.flag_bits:#x}")
    print("\nFMPy's validate_fmu finds:")
    for problem in validate_fmu(path) or ["nothing"]:
        print(f"  {problem}")


main()
