"""Object dictionaries of the emulated CANopen devices, a line an object."""

from canopen import objectdictionary as od

U8, U16, U32 = od.UNSIGNED8, od.UNSIGNED16, od.UNSIGNED32
I8, I16, I32 = od.INTEGER8, od.INTEGER16, od.INTEGER32

Entry = tuple[int, int, int, str, int]
"""Index, sub-index, data type, access, value at power-on."""

COMMUNICATION: tuple[Entry, ...] = (
    (0x1001, 0, U8, "ro", 0),
    (0x1005, 0, U32, "rw", 0x80),
    (0x1006, 0, U32, "rw", 0),
    (0x100C, 0, U16, "rw", 0),
    (0x100D, 0, U8, "rw", 0),
    (0x1016, 0, U8, "ro", 1),
    (0x1016, 1, U32, "rw", 0),
    (0x1017, 0, U16, "rw", 0),
    (0x1018, 0, U8, "ro", 4),
    (0x1018, 1, U32, "ro", 0x0000A55A),
    (0x1018, 2, U32, "ro", 0x00000402),
    (0x1018, 3, U32, "ro", 0x00010000),
    (0x1018, 4, U32, "ro", 1),
)

DRIVE: tuple[Entry, ...] = (
    (0x1000, 0, U32, "ro", 0x00020192),
    (0x603F, 0, U16, "ro", 0),
    (0x6007, 0, I16, "rw", 3),
    (0x6040, 0, U16, "rw", 0),
    (0x6041, 0, U16, "ro", 0),
    (0x605A, 0, I16, "rw", 6),
    (0x6060, 0, I8, "rw", 0),
    (0x6061, 0, I8, "ro", 0),
    (0x6062, 0, I32, "ro", 0),
    (0x6064, 0, I32, "ro", 0),
    (0x6065, 0, U32, "rw", 0xFFFFFFFF),
    (0x6066, 0, U16, "rw", 100),
    (0x607A, 0, I32, "rw", 0),
    (0x607D, 0, U8, "ro", 2),
    (0x607D, 1, I32, "rw", 0),
    (0x607D, 2, I32, "rw", 0),
    (0x6081, 0, U32, "rw", 1 << 20),
    (0x6083, 0, U32, "rw", 10 << 20),
    (0x6084, 0, U32, "rw", 10 << 20),
    (0x6085, 0, U32, "rw", 100 << 20),
    (0x608F, 0, U8, "ro", 2),
    (0x608F, 1, U32, "ro", 1 << 20),
    (0x608F, 2, U32, "ro", 1),
    (0x6091, 0, U8, "ro", 2),
    (0x6091, 1, U32, "rw", 1),
    (0x6091, 2, U32, "rw", 1),
    (0x6092, 0, U8, "ro", 2),
    (0x6092, 1, U32, "rw", 0),
    (0x6092, 2, U32, "rw", 1),
    (0x6098, 0, I8, "rw", 0),
    (0x6099, 0, U8, "ro", 2),
    (0x6099, 1, U32, "rw", 1 << 20),
    (0x6099, 2, U32, "rw", 1 << 18),
    (0x609A, 0, U32, "rw", 10 << 20),
    (0x60A9, 0, U32, "rw", 0),
    (0x60C2, 0, U8, "ro", 2),
    (0x60C2, 1, U8, "rw", 1),
    (0x60C2, 2, I8, "rw", -3),
    (0x60F4, 0, I32, "ro", 0),
    (0x6502, 0, U32, "ro", 0x000000A1),
)

ENCODER: tuple[Entry, ...] = (
    (0x1000, 0, U32, "ro", 0x00080196),
    (0x6000, 0, U16, "rw", 0),
    (0x6004, 0, I32, "ro", 0),
    (0x6500, 0, U16, "ro", 0),
    (0x6501, 0, U32, "ro", 1),
)


def pdo_entries(count: int) -> tuple[Entry, ...]:
    """Return communication and mapping objects of so many RPDOs and TPDOs, all off."""
    entries: list[Entry] = []
    for communication, mapping in ((0x1400, 0x1600), (0x1800, 0x1A00)):
        for number in range(count):
            entries += [
                (communication + number, 0, U8, "ro", 5),
                (communication + number, 1, U32, "rw", 0x80000000),
                (communication + number, 2, U8, "rw", 255),
                (communication + number, 3, U16, "rw", 0),
                (communication + number, 5, U16, "rw", 0),
                (mapping + number, 0, U8, "rw", 0),
                *((mapping + number, sub, U32, "rw", 0) for sub in range(1, 9)),
            ]
    return tuple(entries)


def dictionary(*tables: tuple[Entry, ...]) -> od.ObjectDictionary:
    """Return an object dictionary of these entries."""
    made = od.ObjectDictionary()
    entries = [entry for table in tables for entry in table]
    names = {index for index, sub, *_ in entries if sub}
    records = {index: od.ODRecord(f"{index:04X}", index) for index in names}
    for record in records.values():
        made.add_object(record)
    for index, sub, data_type, access, value in entries:
        name = f"{index:04X}sub{sub:X}" if index in records else f"{index:04X}"
        variable = od.ODVariable(name, index, sub)
        variable.data_type, variable.access_type, variable.default = data_type, access, value
        if index in records:
            records[index].add_member(variable)
        else:
            made.add_object(variable)
    return made
