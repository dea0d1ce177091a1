/* SPDX-License-Identifier: GPL-2.0-or-later */
#include <elf.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hil/board/board.h"

static struct {
	uint8_t *bytes;
	size_t size;
} file;

static _Noreturn void image_refuse(const char *path, const char *what)
{
	fprintf(stderr, "droptower-firmware-board: %s: %s, make stm32g474 builds it\n", path, what);
	exit(BOARD_EXIT_LINK);
}

static void image_read(const char *path)
{
	FILE *stream = fopen(path, "rb");
	long size;

	if (stream == NULL || fseek(stream, 0, SEEK_END) != 0 ||
	    (size = ftell(stream)) < (long)sizeof(Elf32_Ehdr))
		image_refuse(path, "cannot be read");
	rewind(stream);
	file.size = (size_t)size;
	file.bytes = malloc(file.size);
	if (file.bytes == NULL || fread(file.bytes, 1, file.size, stream) != file.size)
		image_refuse(path, "cannot be read");
	fclose(stream);
}

/* `count` entries of `size` bytes at `offset`, all inside the file. */
static const void *image_table(const char *path, size_t offset, size_t count, size_t size)
{
	if (offset > file.size || count > (file.size - offset) / size)
		image_refuse(path, "is cut short");
	return file.bytes + offset;
}

static void image_names(const char *path, const Elf32_Ehdr *head)
{
	static const struct {
		const char *name;
		uint32_t *address, thumb;
	} names[] = {
	        {"app_poll", &board.app_poll, 1},   {"board_mark", &board.mark, 0},
	        {"port_lock", &board.lock, 1},      {"port_unlock", &board.unlock, 1},
	        {"app_on_gate", &board.on_gate, 1}, {"port_can_receive", &board.look, 1},
	};
	const Elf32_Shdr *sections = image_table(path, head->e_shoff, head->e_shnum, sizeof(*sections));

	for (unsigned i = 0; i < head->e_shnum; i++) {
		const Elf32_Sym *symbols;
		const char *text;

		if (sections[i].sh_type != SHT_SYMTAB || sections[i].sh_link >= head->e_shnum)
			continue;
		symbols = image_table(path, sections[i].sh_offset, sections[i].sh_size, 1);
		text = image_table(path, sections[sections[i].sh_link].sh_offset,
		                   sections[sections[i].sh_link].sh_size, 1);
		for (unsigned k = 0; k < sections[i].sh_size / sizeof(*symbols); k++) {
			for (unsigned n = 0; n < sizeof(names) / sizeof(names[0]); n++)
				if (strcmp(text + symbols[k].st_name, names[n].name) == 0)
					*names[n].address = symbols[k].st_value & ~names[n].thumb;
		}
	}
}

void image_load(const char *path)
{
	const Elf32_Ehdr *head;
	const Elf32_Phdr *parts;

	image_read(path);
	head = (const Elf32_Ehdr *)(const void *)file.bytes;
	if (memcmp(head->e_ident, ELFMAG, SELFMAG) != 0 || head->e_machine != EM_ARM ||
	    head->e_ident[EI_CLASS] != ELFCLASS32)
		image_refuse(path, "is no image for the board");
	parts = image_table(path, head->e_phoff, head->e_phnum, sizeof(*parts));
	for (unsigned i = 0; i < head->e_phnum; i++) {
		uint32_t place = parts[i].p_paddr - BOARD_FLASH, size = parts[i].p_filesz;

		if (parts[i].p_type != PT_LOAD || size == 0)
			continue;
		if (place >= BOARD_FLASH_BYTES || size > BOARD_FLASH_BYTES - place)
			image_refuse(path, "does not fit the flash");
		memcpy(board.flash + place, image_table(path, parts[i].p_offset, size, 1), size);
	}
	image_names(path, head);
	if (board.app_poll == 0 || board.lock == 0 || board.unlock == 0 || board.on_gate == 0 ||
	    board.look == 0 || board.mark < BOARD_SRAM || board.mark - BOARD_SRAM > BOARD_SRAM_BYTES - 12)
		image_refuse(path, "lacks a name that this program looks for");
	free(file.bytes);
}
