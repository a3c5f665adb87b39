import { expect, test } from '../fixtures/test.ts';

test('connects the virtual printer', async ({ panel }) => {
  await panel.connectVirtual();
  await expect(panel.messages).toContainText('The printer is ready.');
});
